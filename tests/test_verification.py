"""Published problems at a reduced size, and how `verify` judges them. Full size: `magtip verify`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studies import cli, manufactured, verify
from studies.problems import NotSolvedError

QUICK = {target.name: target for target in verify.targets(quick=True)}
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("name", QUICK)
def test_target_on_its_quick_meshes(name):
    for row in verify.judge(QUICK[name]):
        assert row["passed"], row
        if name == "Cook's membrane":
            assert 1.0 < row["order"] < 1.6, "the clamped corner sets the order"


def test_the_full_run_has_the_same_targets_on_finer_meshes():
    full = verify.targets()
    assert [target.name for target in full] == list(QUICK)
    assert all(target.meshes[-1] >= QUICK[target.name].meshes[-1] for target in full)


@pytest.mark.parametrize("case", manufactured.CASES.values(), ids=list(manufactured.CASES))
def test_manufactured_displacements_keep_volumes(case):
    X, step = RNG.uniform(0.1, 0.9, size=(20, case.dim)), 1e-6
    F = np.stack(
        [(case.displacement(X + e) - case.displacement(X - e)) / (2 * step) for e in step * np.eye(case.dim)], axis=-1
    ) + np.eye(case.dim)
    hoop = 1 + case.displacement(X)[:, 0] / X[:, 0] if case.axisymmetric else 1.0
    np.testing.assert_allclose(np.linalg.det(F) * hoop, 1, atol=1e-8)


@pytest.mark.parametrize("order", [0.5, 1.3, 3.0])
def test_richardson_recovers_a_power_law(order):
    limit, found = verify.richardson((8, 12, 20), [2 - 5 * n**-order for n in (8, 12, 20)])
    assert (limit, found) == pytest.approx((2, order), rel=1e-8)


def test_richardson_gives_up_where_the_meshes_tell_nothing():
    for values in ((1.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 2.0, 4.0), (1.0, 2.0)):
        assert all(math.isnan(value) for value in verify.richardson((1, 2, 4)[: len(values)], values))


def test_a_missed_and_an_unsolved_target_fail_and_say_so(monkeypatch, tmp_path, capsys):
    def unsolved(_):
        raise NotSolvedError("no convergence in 30 iterations")

    good = verify.Target("good", "me", lambda n: (1.0,), (verify.Quantity("q", 1.0, 0.1),))
    missed = replace(good, name="missed", solve=lambda n: (1.2,))
    monkeypatch.setattr(
        verify, "targets", lambda quick: [good, missed, replace(good, name="unsolved", solve=unsolved)]
    )
    assert cli.main(["verify", "--out", str(tmp_path), "--json"]) == cli.FAILED
    said = capsys.readouterr()
    assert "2 of 3 targets are missed: missed (q), unsolved (q)" in said.err
    assert said.out.count("\n") == 3
    assert "no convergence" in said.out
    report = (tmp_path / "VERIFY.md").read_text("utf-8")
    assert "1 of 3 targets are met" in report
    assert report.count("**fail**") == 2
    assert (tmp_path / "verify.csv").read_text("utf-8").count("\n") == 4


def test_all_met_is_status_zero(monkeypatch, capsys):
    good = verify.Target("good", "me", lambda n: (1 + n**-2.0,), (verify.Quantity("q", 1.0, 0.1),), meshes=(4, 8, 16))
    monkeypatch.setattr(verify, "targets", lambda quick: [good])
    assert cli.main(["verify"]) == cli.GOOD
    assert "good" in capsys.readouterr().out
