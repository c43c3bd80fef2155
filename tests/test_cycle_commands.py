"""Verb cycle: its measures against a linear spring, its files, and exit status 2."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from analytic.relaxation_loops import loop
from geometry.design import paper
from geometry.relaxation import relaxation_of
from studies.cli import entry_point
from studies.output.result import INTERRUPTED

QUICK = ["--accuracy", "quick", "--magnet", "ignored"]


def test_loop_of_a_press_is_near_that_of_a_linear_spring(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "cycle",
        "paper",
        "--depth",
        "0.5",
        "--speed",
        "0.5",
        "--cycles",
        "2",
        "--json",
        "--out",
        str(tmp_path / "o"),
    ]
    assert entry_point.main([*words, *QUICK]) == 0
    record = json.loads(capsys.readouterr().out)
    last = record["loops"][-1]
    spring = 100 * loop(relaxation_of(paper()), 0.5).hysteresis
    assert last["gap_percent"] == pytest.approx(spring, rel=0.2)
    assert 0 < last["area_mJ"] < 1.2 * last["material_mJ"]
    assert last["friction_mJ"] == 0
    assert record["drift_percent"] < 0
    assert record["time_error"] < 1e-3
    assert record["balance_error"] < 1e-3
    assert "long-term modulus (the default)" in record["notes"][0]
    table = pd.read_csv(tmp_path / "o" / "cycle.csv")
    assert table["depth_mm"].max() == 0.5
    assert table["S1_V"].nunique() > 10
    assert (tmp_path / "o" / "cycle.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--speed", "0"], "--speed must be above 0 mm/s"),
        (["--frequency", "1e6"], "the branches speak for"),
        (["--speed", "1", "--hold", "100"], "not for 100 s"),
        (["--speed", "1", "--shear", "0.5", "--friction", "0"], "give stick or a coefficient above 0; got 0"),
        (["--speed", "1", "--shear", "1000"], "got 1000 mm"),
        (["--speed", "1", "--shear", "nan"], "--shear must be a finite number of mm; got nan"),
        (["--speed", "1", "--tolerance", "2"], "--tolerance must be at least 1e-07 and below 1"),
        (["--speed", "1", "--tolerance", "1e-300"], "--tolerance must be at least 1e-07 and below 1; got 1e-300"),
        (["--speed", "1", "--gap", "0"], "--gap must be above 0 and below 100 percent of full scale; got 0"),
        (["--speed", "1", "--gap", "5", "--set", "prony=0:0.01 0.2:1 0:100"], "the design has measured branches"),
        (
            ["--speed", "0.5", "--depth", "99"],
            "depth must be less than 7 mm, the silicone on the axis above and below the magnet; got 99",
        ),
    ],
)
def test_impossible_cycles_are_refused(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert entry_point.main(["cycle", "paper", *words]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.startswith("magtip: "), "nothing is solved before the refusal"


def test_a_gap_that_no_loss_factor_has_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    quick = ["--accuracy", "quick", "--cycles", "1", "--depth", "0.2", "--tolerance", "0.02"]
    assert entry_point.main(["cycle", "paper", "--speed", "0.5", "--gap", "90", *quick]) == 3
    assert "no loss factor up to 1 has a gap of 90 %" in capsys.readouterr().err


def test_an_elastic_sensor_has_loops_without_gap(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["cycle", "paper", "--speed", "1", "--cycles", "1", "--set", "loss_factor=0", "--json", *QUICK]
    assert entry_point.main(words) == 0
    record = json.loads(capsys.readouterr().out)
    last = record["loops"][0]
    assert {last[name] for name in ("gap_N", "gap_percent", "area_mJ", "material_mJ", "friction_mJ")} == {0.0}
    assert not any("overstresses" in note or "relaxes" in note for note in record["notes"])


def test_a_fast_cycle_is_warned_of_inertia_and_is_not_yet_steady(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["cycle", "paper", "--depth", "0.2", "--frequency", "400", "--cycles", "1", "--accuracy", "quick"]
    assert entry_point.main(words) == 0
    printed = capsys.readouterr()
    assert "1.2 times the lowest natural frequency of the free sensor, 343 Hz" in printed.err
    assert "the loop of cycle 1, the first one and not yet steady" in printed.err + printed.out


def test_an_interrupt_prints_the_complete_cycles(tmp_path: Path) -> None:
    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    words = ["cycle", "paper", "--depth", "0.1", "--speed", "0.5", "--cycles", "1000", "--out", "o", *QUICK]
    paths = os.pathsep.join(filter(None, (str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH"))))
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths},
        text=True,
    ) as process:
        assert process.stderr is not None
        while "cycle 2 of" not in (line := process.stderr.readline()):
            assert line
        process.send_signal(signal.SIGINT)
        printed, errors = process.communicate()
    assert process.returncode == INTERRUPTED
    assert printed.startswith("Loops, linear overstresses")
    assert "largest" in printed
    assert "of 1000 cycles are complete, and no file is written" in errors
    assert list(tmp_path.iterdir()) == []


def test_a_cycle_beyond_buckling_is_unstable_and_keeps_its_loops(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "cycle",
        "paper",
        "--set",
        "L=24",
        "--magnet",
        "ignored",
        "--depth",
        "2",
        "--speed",
        "1",
        "--cycles",
        "1",
    ]
    assert entry_point.main([*words, "--accuracy", "quick", "--json"]) == 3
    printed = capsys.readouterr()
    record = json.loads(printed.out)
    assert record["status"] == "unstable"
    assert len(record["loops"]) == 1
    assert "a beam whose tip slides freely on the plate buckles sideways" in printed.err
    assert 0.8 < float(record["message"].rsplit("first at ", 1)[1].removesuffix(" s")) < 1.1
