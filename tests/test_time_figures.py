"""Figures of vibrations and of loading cycles, from the columns that the verbs write."""

import numpy as np

from studies.report import report_sections, sweep_figures, time_figures
from studies.report.folder_contents import Contents, Table


def table(name, **columns):
    """A table as it is read from a CSV file."""
    return Table(name, {key: np.array([str(v) for v in values], dtype=object) for key, values in columns.items()})


RESPONSE = table(
    "response.csv",
    motion=["z"] * 3 + ["x"] * 3,
    frequency_Hz=[1, 10, 100] * 2,
    force_N_per_mm=[5.0] * 6,
    S1_V_per_N=[0.2, 0.3, 0.1, 0.4, 0.4, 0.2],
    S1_per_N_phase_deg=[170.0, 165.0, 100.0, -2.0, -3.0, -90.0],
    S2_V_per_N=["", "", "", 0.1, 0.1, 0.1],
    S2_per_N_phase_deg=["", "", "", 0.0, 0.0, 0.0],
)
CYCLE = table(
    "cycle.csv",
    law=["prony"] * 4,
    time_s=[1, 2, 3, 4],
    cycle=[1, 1, 1, 1],
    depth_mm=[0.5, 1.0, 0.5, 0.0],
    shear_mm=[0.0] * 4,
    force_z_N=[1.0, 3.0, 0.8, 0.0],
    force_x_N=[0.0] * 4,
    decoded_force_N=["", "", "", ""],
)


def test_gains_are_over_the_lowest_frequency_and_phases_are_those_to_the_force():
    gain, phase = time_figures.response(RESPONSE)
    assert [panel.title for panel in gain.panels] == ["motion along z", "motion along x"]
    assert gain.panels[0].series[0].y == (1.0, 1.5, 0.5)
    assert [one.name for one in gain.panels[1].series] == ["S1", "S2"]
    # half a turn is the sign of the reading
    assert phase.panels[0].series[0].y == (-10.0, -15.0, -80.0)
    assert phase.panels[1].series[0].y == (-2.0, -3.0, -90.0)
    assert phase.y.label == "phase to the force (degrees)"
    assert gain.caption.endswith("S2 reads nothing of a motion along z.")


def test_loops_keep_the_order_of_time():
    (figure,) = time_figures.cycle(CYCLE)
    (one,) = figure.panels[0].series
    assert figure.panels[0].title == "linear overstresses"
    assert (one.x, one.y) == ((0.5, 1.0, 0.5, 0.0), (1.0, 3.0, 0.8, 0.0))


def test_a_folder_of_the_verbs_shows_figures_in_place_of_pictures(tmp_path):
    contents = Contents(tmp_path, "", {"response.csv": RESPONSE, "cycle.csv": CYCLE})
    section = report_sections.section(contents, solve=False)
    assert len(section.figures) == 3
    assert section.replaced == {"response_z.png", "response_x.png", "cycle.png"}
    assert not section.remarks


def test_quantities_of_time_are_drawn_over_the_axes_of_a_sweep():
    swept = table(
        "sweep.csv",
        loss_factor=[0.05, 0.1],
        speed_mm_per_s=[1, 1],
        loop_gap_percent=[3.9, 7.8],
        status=["ok", "ok"],
    )
    assert sweep_figures.axes_of(swept) == ["loss_factor"]
    (figure,) = sweep_figures.sweep(swept)
    assert figure.panels[0].series[0].y == (3.9, 7.8)
    assert figure.panels[0].series[0].name == "finite elements"
