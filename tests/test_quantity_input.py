"""Numbers with units: what is converted, and one sentence for everything else."""

import pytest

from studies.inputs.quantity_input import UNITS, quantity


@pytest.mark.parametrize(
    ("value", "unit", "result"),
    [
        (5, "N", 5.0),
        ("5", "N", 5.0),
        ("5 mN", "N", 0.005),
        ("1e3mN", "N", 1.0),
        (" .5  kN ", "N", 500.0),
        ("2 cm", "mm", 20.0),
        ("50 µm", "mm", 0.05),
        ("40 %", "1", 0.4),
        (0.4, "1", 0.4),
        ("750 kPa", "MPa", 0.75),
        ("12 kG", "T", 1.2),
        ("3.125 mV/G", "V/T", 31.25),
        ("31.25 mV/mT", "V/T", 31.25),
        ("130 nT/sqrt(Hz)", "T/sqrt(Hz)", 130e-9),
        ("1.03 g/cm3", "kg/m3", 1030.0),
        ("30 min", "h", 0.5),
    ],
)
def test_value(value, unit, result):
    assert quantity("x", value, unit) == pytest.approx(result, rel=1e-15)


@pytest.mark.parametrize("value", ["5 mN", "7 mN", "3 mN"])
def test_decimal_prefixes_leave_no_rounding(value):
    assert quantity("x", value, "N") == float(value[0]) / 1000


@pytest.mark.parametrize("unit", sorted(UNITS))
def test_every_unit_stands_for_itself(unit):
    assert unit == "1" or UNITS[unit][unit] == 1.0


@pytest.mark.parametrize(
    ("value", "unit", "parts"),
    [
        ("5 n", "N", ["x: 'n' is no unit for it", "did you mean N"]),
        ("5 kg", "N", ["'kg' is no unit", "choose one of N, mN, kN"]),
        ("5 N", "mm", ["'N' is no unit", "choose one of mm"]),
        ("5 m m", "mm", ["'m m' is no unit"]),
        ("five", "N", ["x must be a number in N, such as 5 or \"5 N\"; got 'five'"]),
        ("", "N", ["must be a number in N"]),
        ("nan", "N", ["must be a number in N"]),
        (float("inf"), "N", ["must be a number in N"]),
        (float("nan"), "N", ["must be a number in N"]),
        (True, "N", ["must be a number in N", "True"]),
        ([5], "N", ["must be a number in N"]),
        (40, "1", ["x must lie between 0 and 5; got 40: write 40 % as 0.4"]),
        (-1, "N", ["x must lie between 0 and 5 N; got -1 N"]),
        ("6 kN", "N", ["x must lie between 0 and 5 N; got 6000 N"]),
    ],
)
def test_refusal(value, unit, parts, refused):
    with refused(*parts):
        quantity("x", value, unit, 0.0, 5.0)
