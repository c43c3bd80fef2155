"""Each program in studies/examples runs, and one number of it is right for a reason."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from studies.examples import (
    beam_formula_range,
    decode_recording,
    export_mold,
    press_and_read,
    shear_with_friction,
    size_variant,
)
from studies.sizing import front_yield

FOLDER = Path(press_and_read.__file__).parent


def test_press_reads_the_offset_of_the_paper(capsys):
    """The preset reproduces the paper's offset of S1, 2.87 V; S1 grows when the magnet sinks, S2 and S3 are alike."""
    state, pressed = press_and_read.main()
    assert "S1             2.87" in capsys.readouterr().out
    assert pressed.V[0] > 2.9
    assert pressed.V[1] == pytest.approx(pressed.V[2], abs=1e-9)
    # error estimate of the force at level standard: the promise is 1 %
    assert state.estimates.force < 0.01


def test_formula_holds_from_1_5_mm_on_silicone():
    """(5) goes with the square of the depth, contact with the power 1.5: their ratio goes with the root of it."""
    ratio = {depth: formula / silicone for depth, formula, silicone, _ in beam_formula_range.main()}
    assert all(abs(ratio[depth] - 1) < 0.05 for depth in (1.5, 2.0, 2.5))
    assert ratio[0.5] / ratio[0.25] == pytest.approx(math.sqrt(2), rel=0.02)


def test_the_search_and_a_press_to_the_force_agree_on_the_depth(monkeypatch):
    """The sizing reads the depth from its solved states, with the softest silicone; the press searches for it."""
    # the yield, which the program does not print, is that of `test_sizing_commands`
    monkeypatch.setattr(front_yield, "yield_of", lambda *_, **__: None)
    searched, sized = size_variant.main()
    assert searched == pytest.approx(sized, rel=2e-3)


def test_full_slip_is_mu_times_the_normal_force():
    last = shear_with_friction.main()[-1]
    assert last.slip_share == 1.0
    assert last.response.force[0] / last.response.force[2] == pytest.approx(shear_with_friction.MU, rel=1e-3)


def test_both_pours_are_the_silicone_before_it_shrinks(tmp_path):
    """Beam less magnet, by hand: cylinder of 7 mm and half a ball, less a disc of 4 x 2 mm with edges of 0.1 mm.

    The files are mould and base for printing, and the recipe.
    """
    first, second = export_mold.main(str(tmp_path))
    beam = math.pi * 5**2 * 7 + 2 / 3 * math.pi * 5**3
    magnet = math.pi * 2**2 * 2
    assert (first + second) * (1 - 0.005) ** 3 == pytest.approx(beam - magnet, rel=2e-4)
    files = {path.name for path in tmp_path.glob("[!.]*")}
    printed = ("mold_a", "mold_b", "base")
    assert files >= {"README.md", *(f"{part}{kind}" for part in printed for kind in (".step", ".stl", ".3mf"))}


def test_recording_decodes_to_the_load_that_made_it():
    """Its readings were computed by finite elements: 8.128 N and 0.537 mm, 1.5 mm deep and 1.2 mm aside.

    Level finite is within some 5 % of them there; a converter's step of 1 mV is some 0.02 mm sideways.
    """
    samples = decode_recording.main()
    assert {sample.status for sample in samples} == {"ok"}
    assert samples[6].force[2] == pytest.approx(8.128, rel=0.05)
    assert samples[-1].shift == pytest.approx((0.537, 0.0, -0.557), abs=0.02)


def test_study_shares_solves_between_moduli(run, strict):
    """Under a given depth force goes with E: each pair of rows has the ratio of the moduli."""
    status, out, _ = run("sweep", FOLDER / "size_study.toml", "--json")
    rows = strict(out)
    assert status == 0
    assert len(rows) == 12
    force = {(row["D_mm"], row["E_MPa"], row["depth_mm"]): row["fem_force_N"] for row in rows}
    assert all(force[key] == pytest.approx(key[1] * force[key[0], 1.0, key[2]], rel=1e-9) for key in force)


def test_program_runs_as_a_file(tmp_path):
    """As a reader starts it: without the project's folder on the path for modules beside it."""
    done = subprocess.run(
        [sys.executable, FOLDER / "decode_recording.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.count(" ok") == 11
