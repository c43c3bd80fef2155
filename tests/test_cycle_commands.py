"""Verb cycle: its measures against a linear spring, its files, its doubts, Ctrl-C, and exit status 2."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from analytic.relaxation_loops import loop
from fem.analyses.timed_path import TimedState
from fem.solution import Solution
from geometry.design import paper
from geometry.loads import Response
from geometry.relaxation import relaxation_of
from studies.mechanics.cycle_motion import Motion, stops
from studies.mechanics.loading_cycles import Cycles, CycleState, Static
from studies.output.result import INTERRUPTED
from studies.simulation.cycle_findings import doubts

QUICK = ("--accuracy", "quick", "--magnet", "ignored")
LOOP = {"cycle": 1, "area_mJ": 0.3, "material_mJ": 0.3, "friction_mJ": 0.0}


def test_loop_of_a_press_is_near_that_of_a_linear_spring(run, strict, tmp_path):
    words = ("--depth", 0.5, "--speed", 0.5, "--cycles", 2, "--json", "--out", tmp_path / "o")
    status, out, _ = run("cycle", "paper", *words, *QUICK)
    (record,) = strict(out)
    last = record["loops"][-1]
    spring = 100 * loop(relaxation_of(paper()), 0.5).hysteresis
    assert status == 0
    assert last["gap_percent"] == pytest.approx(spring, rel=0.2)
    assert 0 < last["area_mJ"] < 1.2 * last["material_mJ"]
    assert last["friction_mJ"] == 0
    assert record["drift_percent"] < 0
    assert max(record["time_error"], record["balance_error"]) < 1e-3
    assert "long-term modulus (the default)" in record["notes"][0]
    table = pd.read_csv(tmp_path / "o" / "cycle.csv")
    assert table["depth_mm"].max() == 0.5
    assert table["S1_V"].nunique() > 10
    assert (tmp_path / "o" / "cycle.png").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--speed 0", "--speed must be above 0 mm/s"),
        ("--frequency 1e6", "the branches speak for"),
        ("--speed 1 --hold 100", "not for 100 s"),
        ("--speed 1 --shear 0.5 --friction 0", "give stick or a coefficient above 0; got 0"),
        ("--speed 1 --shear 1000", "got 1000 mm"),
        ("--speed 1 --shear nan", "--shear must be a finite number of mm; got nan"),
        ("--speed 1 --tolerance 2", "--tolerance must be at least 1e-07 and below 1"),
        ("--speed 1 --tolerance 1e-300", "--tolerance must be at least 1e-07 and below 1; got 1e-300"),
        ("--speed 1 --gap 0", "--gap must be above 0 and below 100 percent of full scale; got 0"),
        ("--speed 0.5 --depth 99", "depth must be less than 7 mm, the silicone on the axis above and below"),
    ],
)
def test_impossible_cycles_are_refused_before_a_solve(words, message, refusal):
    assert message in refusal("cycle", "paper", *words.split())


def test_a_gap_is_searched_for_only_where_no_branches_are_measured(refusal):
    assert "the design has measured branches" in refusal(
        "cycle", "paper", "--speed", 1, "--gap", 5, "--set", "prony=0:0.01 0.2:1 0:100"
    )


def test_a_gap_that_no_loss_factor_has_is_told(run):
    rough = ("--cycles", 1, "--depth", 0.2, "--tolerance", 0.02)
    status, _, err = run("cycle", "paper", "--speed", 0.5, "--gap", 90, *rough, *QUICK)
    assert status == 3
    assert "no loss factor up to 1 has a gap of 90 %" in err


def test_an_elastic_sensor_has_loops_without_gap(run, strict):
    words = ("--speed", 1, "--cycles", 1, "--set", "loss_factor=0", "--json")
    (record,) = strict(run("cycle", "paper", *words, *QUICK)[1])
    last = record["loops"][0]
    assert {last[name] for name in ("gap_N", "gap_percent", "area_mJ", "material_mJ", "friction_mJ")} == {0.0}
    assert not any("overstresses" in note or "relaxes" in note for note in record["notes"])


def test_a_fast_cycle_is_warned_of_inertia_and_is_not_yet_steady(run):
    words = ("--depth", 0.2, "--frequency", 400, "--cycles", 1, "--accuracy", "quick")
    status, out, err = run("cycle", "paper", *words)
    assert status == 0
    assert "1.2 times the lowest natural frequency of the free sensor, 343 Hz" in err
    assert "the loop of cycle 1, the first one and not yet steady (--cycles), has a gap of" in out


def test_an_interrupt_prints_the_complete_cycles(tmp_path):
    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    words = [
        "cycle",
        "paper",
        "--depth",
        "0.1",
        "--speed",
        "0.5",
        "--cycles",
        "1000",
        "--tolerance",
        "0.02",
        "--out",
        "o",
    ]
    paths = os.pathsep.join(filter(None, (str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH"))))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(
        [sys.executable, "-c", code, *words, *QUICK], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, **pipes
    ) as process:
        while "cycle 2 of" not in (line := process.stderr.readline()):
            assert line
        process.send_signal(signal.SIGINT)
        printed, errors = process.communicate()
    assert process.returncode == INTERRUPTED
    assert printed.startswith("Loops, linear overstresses")
    assert "largest" in printed
    assert "of 1000 cycles are complete, and no file is written" in errors
    assert list(tmp_path.iterdir()) == []


def test_a_cycle_beyond_buckling_is_unstable_and_keeps_its_loops(run, strict):
    words = ("--set", "L=24", "--depth", 2, "--speed", 1, "--cycles", 1, "--json")
    status, out, err = run("cycle", "paper", *words, *QUICK)
    (record,) = strict(out)
    assert (status, record["status"], len(record["loops"])) == (3, "unstable", 1)
    assert "a beam whose tip slides freely on the plate buckles sideways" in err
    assert 0.8 < float(record["message"].rsplit("first at ", 1)[1].removesuffix(" s")) < 1.1


# Sentences that say when loops should not be trusted


def cycles(force_out=1.0, loop=LOOP):
    states = []
    for stop in stops(Motion(1.0, 0.0, "none", 1.0, cycles=1)):
        z = force_out if stop.phase == "out" else 1.0
        response = Response(force=(0.0, 0.0, z), shift=(0.0, 0.0, 0.0), tilt=0.0, contact_radius=1.0)
        state = TimedState(
            stop.timed.time,
            Solution(stop.timed.load, response, 0.0, "axisymmetric", 1, 1, 0.0, None),
            0.0,
            0.0,
            0.0,
            1,
        )
        states.append(CycleState(stop, state, True, (0.0, 0.0, 0.0), 0.0, 0.0))
    return Cycles("prony", "ok", "", states, [loop], "V", 1.0)


@pytest.mark.parametrize(
    ("stop", "loops", "said"),
    [
        ("", cycles(), []),
        ("stopped at depth 5.7 mm", cycles(), ["does not reach the end of the stroke (stopped at depth 5.7 mm)"]),
        ("", cycles(loop=LOOP | {"material_mJ": -0.1}), ["the silicone gains 0.1 mJ in cycle 1, which no"]),
        ("", cycles(force_out=0.0), ["does not touch the plate at mid-stroke on the way out"]),
    ],
)
def test_loops_that_should_not_be_trusted_are_told(stop, loops, said):
    texts = doubts(Static(None, 0.001, stop), loops)
    assert len(texts) == len(said)
    assert all(part in text for part, text in zip(said, texts, strict=True))
