"""Figures of the studies: what they hold of the tables that the verbs write, and what they say."""

from pathlib import Path

import numpy as np
import pytest

from studies.sensitivity import uncertainty_figures
from studies.simulation import comparison_figures, time_figures
from studies.sizing import sizing_figures
from studies.web import folder_contents, paper_figures, report_sections, verdict_figures
from studies.web.folder_contents import Contents, Table

RESULTS = Path(__file__).resolve().parent.parent / "results"


def read(*path):
    return folder_contents.csv_table(RESULTS.joinpath(*path)).frame


def parse(text):
    """A table as it is read from a CSV file."""
    head, *rows = [line.split(",") for line in text.strip().splitlines()]
    return folder_contents.frame_of({name: [row[k] for row in rows] for k, name in enumerate(head)})


def of(figure, **values):
    """The rows of a figure with these values."""
    data = figure.data
    for name, value in values.items():
        data = data[data[name] == value]
    return data


# comparisons and states


def test_states_are_grouped_by_depth(tmp_path):
    lines = [
        f'{{"depth_mm": {d}, "shear_mm": {s}, "status": "ok", "force_N": [{s}, 0, {d}], "shift_mm": [0, 0, 0]}}'
        for d in (1, 2)
        for s in (0, 1, 2)
    ]
    (tmp_path / "states.jsonl").write_text("\n".join(lines))
    force, _ = comparison_figures.states(folder_contents.states_table(tmp_path / "states.jsonl").frame)
    assert list(dict.fromkeys(force.data["series"])) == ["depth 1 mm", "depth 2 mm"]
    assert of(force, series="depth 1 mm", panel="along x")["force (N)"].tolist() == [0, 1, 2]


# vibrations and loading cycles

RESPONSE = parse("""
motion,frequency_Hz,force_N_per_mm,S1_V_per_N,S1_per_N_phase_deg,S2_V_per_N,S2_per_N_phase_deg
z,1,5,0.2,170,,
z,10,5,0.3,165,,
z,100,5,0.1,100,,
x,1,5,0.4,-2,0.1,0
x,10,5,0.4,-3,0.1,0
x,100,5,0.2,-90,0.1,0
""")
CYCLE = parse("""
law,time_s,cycle,depth_mm,shear_mm,force_z_N,force_x_N,decoded_force_N
prony,1,1,0.5,0,1,0,
prony,2,1,1,0,3,0,
prony,3,1,0.5,0,0.8,0,
prony,4,1,0,0,0,0,
""")


def test_gains_are_over_the_lowest_frequency_and_phases_are_those_to_the_force():
    gain, phase = time_figures.response(RESPONSE)
    up = of(gain, panel="motion along z")
    assert up["gain per N over that at 1 Hz"].tolist() == pytest.approx([1.0, 1.5, 0.5])
    assert set(of(gain, panel="motion along x")["series"]) == {"S1", "S2"}
    # half a turn is the sign of the reading
    name = "phase to the force (degrees)"
    assert of(phase, panel="motion along z")[name].tolist() == [-10.0, -15.0, -80.0]
    assert of(phase, panel="motion along x", series="S1")[name].tolist() == [-2.0, -3.0, -90.0]
    assert gain.caption.endswith("S2 reads nothing of a motion along z.")


def test_loops_keep_the_order_of_time():
    loop, over_time = time_figures.cycle(CYCLE)
    assert set(loop.data["panel"]) == {"linear overstresses"}
    assert loop.data["depth (mm)"].tolist() == [0.5, 1.0, 0.5, 0.0]
    assert loop.data["press force (N)"].tolist() == [1.0, 3.0, 0.8, 0.0]
    assert set(over_time.data["series"]) == {"of the plate"}
    line = next(part for part in loop.chart.to_dict()["spec"]["layer"] if part["mark"]["type"] == "line")
    assert line["encoding"]["order"]["field"] == "order"


def test_a_folder_of_the_verbs_shows_figures_in_place_of_pictures(tmp_path):
    tables = {"response.csv": Table("response.csv", RESPONSE), "cycle.csv": Table("cycle.csv", CYCLE)}
    section = report_sections.section(Contents(tmp_path, "", tables), solve=False)
    assert len(section.figures) == 4
    assert section.replaced == {"response_z.png", "response_x.png", "cycle.png"}
    assert not section.remarks


# sizing

FRONT = parse("""
rank,point,status,D_mm,L_mm,magnet,silicone,hall_part,outer_size_mm,fem_range_z_N,fem_resolution_z_mN,range_z_difference_percent
1,1,ok,8,9,disc 4 x 2,Dragon Skin 30,SS495A,12,6,4,1.5
2,2,ok,9,9,disc 5 x 2,,SS495A,14,8,9,-2
,3,failed,6,9,,,,9,3,2,-6
""")


def test_front_tells_the_best_from_the_removed():
    resolution, size, differences = sizing_figures.front(FRONT)
    assert resolution.data["series"].tolist() == [
        "best variant",
        "meets all requirements",
        "removed by finite elements",
    ]
    assert resolution.data["label"].tolist() == ["1", "2", ""]
    assert resolution.data["range z (N)"].tolist() == [6, 8, 3]
    assert resolution.caption.startswith("2 of 3 variants")
    assert "D 8 mm, L 9 mm, disc 4 x 2" in resolution.caption
    assert "outer size (mm)" in size.data
    assert "range z, -6 %" in differences.caption
    assert len(differences.data) == 3


# sensitivity


def test_sobol_indices_have_both_orders_and_their_intervals():
    head = "output,input,first_order,first_order_low,first_order_high,total_order,total_order_low,total_order_high"
    rows = ["force_N,E,0.9,0.8,1,0.95,0.9,1", "force_N,nu,0.05,0,0.1,0.1,0.05,0.2", "tilt_rad,E,,,,,,"]
    (figure,) = uncertainty_figures.sobol(
        parse("\n".join([head + ",points,failed", *[f"{row},100,3" for row in rows]]))
    )
    assert set(figure.data["panel"]) == {"force (N)"}
    first = of(figure, series="first order")
    assert first["index (share of the variance)"].tolist() == [0.9, 0.05]
    assert (first["low"].tolist(), first["high"].tolist()) == ([0.8, 0.0], [1.0, 0.1])
    assert "force E (0.95)" in figure.caption
    assert "3 of 100 points failed" in figure.caption


def test_failed_sensors_are_never_below():
    head = "sensor,status,E_MPa,z_sensitivity_V_per_N,z_zeroed_force_error_N,z_recalibrated_force_error_N"
    rows = ["1,ok,1,0.01,0.1,0.001", "2,ok,1,0.02,0.3,0.002", "3,failed,1,,,", "4,ok,1,0.03,0.2,0.003"]
    (figure,) = uncertainty_figures.made_sensors(parse("\n".join([head, *rows])))
    panels = ["sensitivity (V/N)", "force error after zeroing (N)", "force error after recalibration (N)"]
    assert list(dict.fromkeys(figure.data["panel"])) == panels
    zeroed = of(figure, panel=panels[1])
    assert zeroed[uncertainty_figures.VALUE].tolist() == [0.1, 0.2, 0.3]
    assert zeroed[uncertainty_figures.BELOW].tolist() == [25, 50, 75]
    assert "1 failed" in figure.caption


# studies that judge


def test_missed_checks_stand_right_of_the_bound():
    table = read("verify", "verify.csv")
    (figure,) = verdict_figures.verification(table)
    share = figure.data.set_index("series")["error / tolerance"]
    assert share["passed"].max() <= 1
    assert len(share["missed"]) == 3
    assert share["missed"].min() > 1
    assert figure.caption.startswith(f"{len(table) - 3} of {len(table)} checks passed")


def test_trade_has_the_medians_of_its_page():
    """TRADE.md, press: axisymmetric quick 0.15, standard 0.088 and fine 0.034; finite 0.65."""
    (figure,) = verdict_figures.trade(read("trade", "trade.csv"))
    error = of(figure, panel="press", series="axisymmetric")["error of the force (%)"]
    assert error.tolist() == pytest.approx([0.15, 0.088, 0.034], rel=0.02)
    (finite,) = of(figure, panel="press", point="formula finite, 31 states")["error of the force (%)"]
    assert finite == pytest.approx(0.65, rel=0.02)


# the paper


def test_maps_hold_the_errors_of_the_table():
    sweep = read("assumption", "sweep.csv")
    drawn = paper_figures.assumption(sweep)
    assert len(drawn) == 10
    assert drawn[0].title == "Error of the press force, level paper"
    cells = drawn[0].data["error (%)"].dropna()
    errors = sweep[(sweep["nu"] == 0.4998) & (sweep["shear_mm"] == 0)]["analytic_paper_force_error_percent"].dropna()
    # the errors of the map come from forces of six digits
    np.testing.assert_allclose(sorted(cells), sorted(errors), rtol=1e-5, atol=2e-3)


def test_the_map_marks_presses_that_a_free_tip_does_not_reach():
    """Beyond the critical depth the numbers are those of a tip that the press holds on the axis."""
    sweep = read("assumption", "sweep.csv")
    force = next(
        one for one in paper_figures.assumption(sweep) if one.title == "Error of the press force, level paper"
    )
    presses = sweep[(sweep.nu == sweep.nu.max()) & (sweep.shear_mm == 0) & sweep.fem_force_N.notna()]
    beyond = presses[presses.depth_mm > presses.critical_depth_mm]
    assert force.data.doubted.sum() == len(beyond) > 0
    assert any(note.startswith("Dots: a tip that is free to slide") for note in force.notes)
