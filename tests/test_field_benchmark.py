"""The bench of the field on a few points, and its table."""

import math

import numpy as np
import pytest

from studies.benchmarks import field_benchmark, field_reference, field_report


def test_truth_is_the_closed_form_on_the_axis_and_a_gradient():
    assert field_reference.field((0, 0, 5.0), 2, 4)[2] == pytest.approx(77.684e-3 / 1.2, rel=1e-5)
    slope = field_reference.jacobian((1.0, 0.5, 3.0), 2, 2)
    assert field_reference.relative(slope, slope.T) < 1e-12
    assert abs(np.trace(slope)) < 1e-12 * np.linalg.norm(slope)


@pytest.mark.parametrize("flatness", field_benchmark.FLATNESS)
def test_regions_are_where_they_say(flatness):
    a, h = field_benchmark.RADIUS, field_benchmark.RADIUS * flatness
    found = {
        name: (np.hypot(p[:, 0], p[:, 1]), np.abs(p[:, 2]))
        for name, p in field_benchmark.regions(flatness, 50).items()
    }
    rho, z = found["inside"]
    assert (rho < a).all()
    assert (z < h / 2).all()
    assert (np.abs(found["1e-12 radii from the hull"][0] / a - 1) < 2e-12).all()
    rho, z = found["1e-12 to 1e-2 radii from the rim"]
    assert (np.hypot(rho - a, z - h / 2) < 0.011 * a).all()
    assert (np.hypot(*found["1e3 to 1e6 radii away"]) > 999 * a - h).all()


def test_small_run_keeps_the_promise(monkeypatch):
    monkeypatch.setattr(field_benchmark, "FLATNESS", (1.0,))
    rows = field_benchmark.errors(count=3, jacobians=1)
    assert max(max(row.numpy, row.compiled) for row in rows) < field_report.PROMISE
    times = field_benchmark.speed(count=2000, runs=1)
    assert [time.program.split()[0].strip(",") for time in times] == [
        "compiled",
        "compiled",
        "compiled",
        "NumPy",
        "NumPy",
        "magpylib",
    ]
    assert all(time.many_us > 0 and time.clock_us > 0 and time.one_us > 0 for time in times)
    assert (times[-1].faster, times[0].shorter) == (1, 1)
    waits = [field_report.FirstCall("again", 0.1, 0.0, 0.6)]
    text = field_report.report(rows, times, waits, {"numpy": "2"}, field_benchmark.ABOUT)
    assert "| inside |" in text
    assert math.isnan(times[-1].none_us) == ("refused" in text)
