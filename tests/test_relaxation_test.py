"""CSV files of relaxation tests and dynamic tests: units, moduli, held stretches, and what is refused."""

import numpy as np
import pytest

from geometry.design import BadInput
from studies.simulation.material_tests import kind_of, read

TIMES = np.geomspace(0.1, 100, 8)


@pytest.fixture
def file(tmp_path):
    def write(header, rows):
        path = tmp_path / "t.csv"
        path.write_text("\n".join([header, *(",".join(f"{value:.9g}" for value in row) for row in rows), ""]))
        return str(path)

    return write


def rows(*columns, times=TIMES):
    return list(
        zip(times, *([column] * len(times) if np.isscalar(column) else column for column in columns), strict=True)
    )


@pytest.mark.parametrize(
    ("header", "factor", "kind", "values", "E"),
    [
        ("time_s,youngs_modulus_MPa", 1, "relaxation", [1.0], 1.0),
        ("time_min,youngs_modulus_kPa", 60, "relaxation", [1.0], 1e-3),
        ("time_ms,shear_modulus_MPa", 1e-3, "relaxation", [1.0], 3.0),
        ("time_s,stretch,nominal_stress_MPa", 1, "relaxation", [1.5, 1.5 - 1.5**-2], 3.0),
        ("time_s,strain_percent,nominal_stress_kPa", 1, "relaxation", [-20, 1e3 * (0.8 - 0.8**-2)], 3.0),
        ("frequency_Hz,storage_modulus_MPa,loss_modulus_MPa", 1, "dynamic", [2.0, 0.5], 2 + 0.5j),
        ("frequency_Hz,shear_storage_modulus_kPa,tan_delta", 1, "dynamic", [2e3, 0.25], 6 + 1.5j),
        (
            "angular_frequency_rad_per_s,storage_modulus_Pa,loss_modulus_Pa",
            1 / (2 * np.pi),
            "dynamic",
            [1e6, 1e5],
            1 + 0.1j,
        ),
    ],
)
def test_columns_become_youngs_moduli_in_MPa(file, header, factor, kind, values, E):
    path = file(header, rows(*values))
    test = read(path, 0.5)
    assert kind_of(path) == test.kind == kind
    assert test.at == pytest.approx(factor * TIMES, rel=1e-8)
    assert test.values == pytest.approx(np.full(8, E), rel=1e-7)
    assert test.has_modulus


def test_options_state_what_no_column_has(file):
    path = file("time_s,nominal_stress_MPa", rows(1.5 - 1.5**-2))
    test = read(path, 0.5, stretch=1.5, ramp=0.4)
    assert test.values == pytest.approx(np.full(8, 3.0), rel=1e-7)
    assert test.covered == pytest.approx((0.4, 100.0))
    assert not read(path, 0.5).has_modulus


def test_a_frequency_stands_for_a_time(file):
    path = file("frequency_Hz,storage_modulus_MPa,tan_delta", rows(1.0, 0.1))
    assert read(path, 0.5).covered == pytest.approx((1 / (200 * np.pi), 1 / (0.2 * np.pi)))


MODULUS = "time_s,youngs_modulus_MPa"
STRESS = "time_s,nominal_stress_MPa"
HELD = "time_s,stretch,nominal_stress_MPa"
DYNAMIC = "frequency_Hz,storage_modulus_MPa,"


@pytest.mark.parametrize(
    ("header", "content", "options", "message"),
    [
        ("time,youngs_modulus_MPa", rows(1.0), {}, "name of column 'time' has no unit: call it time_s or time_ms"),
        ("time_s,youngs_modulus", rows(1.0), {}, "has no unit: call it"),
        (STRESS + ",strain_percent", rows(0.15, 0.25), {}, "if they were those of a column strain"),
        ("frequency,storage_modulus_MPa,tan_delta", rows(1.0, 0.1), {}, "the name of column 'frequency' has no unit"),
        ("frequency_Hz,storage_modulus,tan_delta", rows(1.0, 0.1), {}, "'storage_modulus' has no unit"),
        (DYNAMIC + "loss", rows(1.0, 0.1), {}, "name of column 'loss' has no unit: call it loss_modulus_MPa or"),
        (DYNAMIC + "shear_loss_modulus_MPa", rows(1.0, 0.1), {}, "must both be Young's moduli"),
        ("time_s,foo", rows(1.0), {}, "the header needs a column nominal_stress_MPa or"),
        (DYNAMIC.removesuffix(","), rows(1.0), {}, "or tan_delta besides frequency_Hz, storage_modulus_MPa"),
        (MODULUS, rows(1.0), {"stretch": 1.2}, "which needs no held stretch: leave --stretch out"),
        (STRESS, [], {"ramp": 1.0}, "has a header but no rows: add a row"),
        (MODULUS, rows(1.0)[:5], {}, "has too few points (5): a fit of branches needs at least 6"),
        (MODULUS, rows(1.0, times=TIMES - 0.1), {}, "line 2, column time_s: a time must be more than 0"),
        (MODULUS, rows(1.0, times=TIMES[::-1]), {}, "line 3, column time_s: each time must be greater"),
        (MODULUS, rows(1.0, times=np.repeat(TIMES, 2)), {}, "sort the rows, drop repeats; got 0.1"),
        (MODULUS, rows(-1.0), {}, "a modulus must be more than 0; got -1"),
        (DYNAMIC + "tan_delta", rows(-1.0, 0.1), {}, "a storage modulus must be more than 0"),
        (DYNAMIC + "tan_delta", rows(1.0, -0.1), {}, "a loss must be 0 or more; got -0.1"),
        (STRESS, rows(-1.0), {"stretch": 1.2}, "tension must be positive and compression negative"),
        (STRESS, rows(1.0), {"stretch": 1.0}, "held stretch must lie between 0.05 and 20 and differ from 1; got 1"),
        (STRESS, rows(1.0), {"ramp": 100.0}, "end before the last time, 100 s; got 100 s"),
        (STRESS, rows(1.0), {"ramp": -1.0}, "the ramp must last 0 s or longer"),
        (HELD, rows(TIMES, 1.0), {}, "column stretch: must be held at 100; got 0.1"),
        (HELD, rows(1.5, 1.0), {"stretch": 1.5}, "leave --stretch out"),
        ("time_s,ramp_s,youngs_modulus_MPa", rows(0.1, 1.0), {"ramp": 0.1}, "leave --ramp out"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(file, header, content, options, message):
    with pytest.raises(BadInput) as raised:
        read(file(header, content), 0.5, **options)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_table_of_times_and_frequencies_is_refused_with_both_columns(file):
    with pytest.raises(BadInput, match=r"columns time_s and frequency_Hz belong to a relaxation test and a dynamic"):
        kind_of(file("frequency_Hz,time_s,storage_modulus_MPa,tan_delta", rows(1.0, 1.0, 0.1)))
