"""Verdicts where the extras are missing: `make plain` runs this file in an environment that has none."""

import importlib.util
import os

import pytest
from conftest import BY_PLAIN

SLENDER = ("paper", "--set", "L=32", "--set", "l0=30.2", "--magnet", "ignored", "--accuracy", "quick", "--json")


@pytest.mark.skipif(not os.environ.get("MAGTIP_PLAIN"), reason=BY_PLAIN)
def test_no_extra_is_installed():
    assert [name for name in ("mkl", "distributed") if importlib.util.find_spec(name)] == []


def test_a_slender_press_buckles(run, strict):
    status, out, _ = run("stability", *SLENDER)
    (answer,) = strict(out)
    assert status == 0
    assert answer["critical_depth_mm"] == pytest.approx(0.6613, abs=2e-4)
    assert answer["guided_critical_depth_mm"] == pytest.approx(4.2566, abs=2e-3)


def test_a_press_beyond_that_is_unstable(run, strict):
    status, out, _ = run("solve", *SLENDER, "--model", "harmonic", "--depth", "2")
    (state,) = strict(out)
    assert status == 3
    assert (state["status"], state["stability"], state["unstable_directions"]) == ("unstable", "unstable", 1)
    assert state["force_N"][2] == pytest.approx(2.512, rel=1e-3)


def test_a_press_before_it_is_stable(run, strict):
    status, out, _ = run("solve", *SLENDER, "--model", "harmonic", "--depth", "0.5")
    (state,) = strict(out)
    assert (status, state["status"], state["stability"], state["unstable_directions"]) == (0, "ok", "stable", 0)
