"""Published problems at a reduced size, and how `verify` judges them. Full size: `magtip verify`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from studies import cli, manufactured, problems, verify
from studies.problems import NotSolvedError

BY_NAME = {target.name: target for target in verify.targets()}
RNG = np.random.default_rng(3)


def rows_of(name, **changes):
    return verify.judge(replace(BY_NAME[name], meshes=BY_NAME[name].quick, **changes))


@pytest.mark.parametrize("name", [name for name in BY_NAME if name != "Reese's block"])
def test_target_on_its_quick_meshes(name):
    for row in rows_of(name):
        assert row["passed"], row


def test_cooks_membrane_has_the_order_of_its_clamped_corner():
    (row,) = rows_of("Cook's membrane")
    assert 1.0 < row["order"] < 1.6


def test_reese_block():
    """On a coarse mesh, p/p0 = 20, 40; the tolerance is the target's own."""
    assert problems.reese_block(4, (20, 40)) == pytest.approx((22.0, 42.5), abs=0.5)


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
    monkeypatch.setattr(verify, "targets", lambda: [good, missed, replace(good, name="unsolved", solve=unsolved)])
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
    monkeypatch.setattr(verify, "targets", lambda: [good])
    assert cli.main(["verify"]) == cli.GOOD
    assert "good" in capsys.readouterr().out
