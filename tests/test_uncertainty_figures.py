import pytest

from studies.report import folder_contents, uncertainty_figures


@pytest.fixture
def table(tmp_path):
    def write(text):
        (tmp_path / "t.csv").write_text(text)
        return folder_contents.csv_table(tmp_path / "t.csv")

    return write


def test_sobol_indices_have_both_orders_and_their_intervals(table):
    head = "output,input,first_order,first_order_low,first_order_high,total_order,total_order_low,total_order_high"
    rows = ["force_N,E,0.9,0.8,1,0.95,0.9,1", "force_N,nu,0.05,0,0.1,0.1,0.05,0.2", "tilt_rad,E,,,,,,"]
    (figure,) = uncertainty_figures.sobol(
        table("\n".join([head + ",points,failed", *[row + ",100,3" for row in rows]]))
    )
    (panel,) = figure.panels
    first, total = panel.series
    assert (first.x, first.low, first.high) == ((0.9, 0.05), (0.8, 0.0), (1.0, 0.1))
    assert total.x == (0.95, 0.1)
    assert first.across
    assert "force E (0.95)" in figure.caption
    assert "3 of 100 points failed" in figure.caption


def test_morris_has_a_style_for_each_input(table):
    head = "output,input,mu_star,mu_star_low,mu_star_high,sigma,effect_unit,points,failed"
    rows = ["force_N,E,0.8,0.7,0.9,0.1,N per full range,12,0", "force_N,nu,0.1,0,0.2,0.3,N per full range,12,0"]
    (figure,) = uncertainty_figures.morris(table("\n".join([head, *rows])))
    assert [(one.name, one.x, one.y, one.style) for one in figure.panels[0].series] == [
        ("E", (0.8,), (0.1,), 0),
        ("nu", (0.1,), (0.3,), 1),
    ]
    assert figure.panels[0].x.endswith("(N per full range)")


def test_failed_sensors_are_never_below(table):
    head = "sensor,status,E_MPa,z_sensitivity_V_per_N,z_zeroed_force_error_N,z_recalibrated_force_error_N"
    rows = ["1,ok,1,0.01,0.1,0.001", "2,ok,1,0.02,0.3,0.002", "3,failed,1,,,", "4,ok,1,0.03,0.2,0.003"]
    (figure,) = uncertainty_figures.made_sensors(table("\n".join([head, *rows])))
    assert [panel.title for panel in figure.panels] == [
        "sensitivity",
        "force error after zeroing",
        "force error after recalibration",
    ]
    assert figure.panels[1].series[0].x == (0.1, 0.2, 0.3)
    assert figure.panels[1].series[0].y == (25, 50, 75)
    assert "1 failed" in figure.caption
    assert figure.panels[0].x == "sensitivity (V/N)"
