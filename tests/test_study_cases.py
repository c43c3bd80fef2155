"""Cases of a study: batches of any cut are the same cases, and codes tell apart what the mechanics depend on."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from geometry.design import paper
from geometry.loads import Load
from studies.inputs.study_input import Factor, grid
from studies.mechanics.study_cases import Cases, FemModel, Plan, Recent, load_of, varied

PLAN = Plan(
    paper(),
    (*grid({"f": [5.0, 6.0], "D": [7.0, 8.0, 3.0]}), Factor(("E", "depth"), ((1.0, 2.0), (0.5, 1.0)))),
    {},
    "rigid",
    (FemModel("quick", QUICK),),
    ("paper",),
    ("force",),
)

NORTH = (Factor(("magnet_north",), (("down", "up"),)),)


def seen(cases, indices):
    """The values, sensors and problems of cases."""
    batch = cases.batch(np.array(indices))
    return [
        (
            {name: values[k] if name == "magnet_north" else float(values[k]) for name, values in batch.axes.items()},
            float(batch.E[k]),
            batch.sensors[batch.sensor[k]],
            batch.problems[batch.problem[k]],
        )
        for k in range(len(batch))
    ]


def test_batches_do_not_depend_on_how_the_study_is_cut():
    cases = Cases(PLAN)
    alone = [seen(Cases(PLAN), [k])[0] for k in range(PLAN.count)]
    together = seen(cases, range(PLAN.count))
    for one, other in zip(alone, together, strict=True):
        assert one[:3] == other[:3]
        # f does not change the mechanics: problems may come from a case with another f
        assert (one[3].load, one[3].message) == (other[3].load, other[3].message)
        if one[3].design is not None:
            assert one[3].design.shape == other[3].design.shape
    part = cases.batch(np.arange(PLAN.count)).part(3, 7)
    assert part.axes["D"].tolist() == [row[0]["D"] for row in alone[3:7]]


def test_the_last_factor_varies_fastest():
    rows = seen(Cases(PLAN), range(4))
    assert [(row[0]["f"], row[0]["D"], row[0]["depth"]) for row in rows] == [
        (5.0, 7.0, 0.5),
        (5.0, 7.0, 1.0),
        (5.0, 8.0, 0.5),
        (5.0, 8.0, 1.0),
    ]


def test_f_and_E_make_no_further_problems():
    assert Cases(PLAN).distinct_problems().tolist() == [0, 1, 2, 3, 4, 5]
    only_E = Plan(**{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": grid({"E": [1.0, 2.0]})})
    assert Cases(only_E).distinct_problems().tolist() == [0]
    turned = Plan(**{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": NORTH})
    assert Cases(turned).distinct_problems().tolist() == [0]
    assert [row[2].magnet_north for row in seen(Cases(turned), range(2))] == ["down", "up"]
    lossy = Plan(
        **{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": grid({"loss_factor": [0.1, 0.2]})}
    )
    assert Cases(lossy).distinct_problems().tolist() == [0]
    pushed = Plan(**{name: getattr(only_E, name) for name in PLAN.__slots__} | {"load": {"imperfection": 0.01}})
    # a dead force is not proportional to E
    assert Cases(pushed).distinct_problems().tolist() == [0, 1]


def test_impossible_cases_say_why():
    impossible = seen(Cases(PLAN), [4])[0]
    assert impossible[2] is None
    assert (impossible[3].design, "magnet" in impossible[3].message) == (None, True)


def test_the_elements_stay_in_the_base_unless_l0_varies():
    assert varied(paper(), {"D": 10.0}).l0 == pytest.approx(6.2)
    assert varied(paper(), {"D": 10.0, "l0": 7.0}).l0 == 7.0
    # a higher magnet needs more than the base design's l0 only before the elements are moved away
    base = replace(paper(), l0=1.5)
    assert varied(base, {"L": 12.0, "magnet_height": 4.0}).l0 == pytest.approx(4.5)


def test_loads_stick_when_they_shear_unless_told_otherwise():
    assert load_of({"depth": 1.0}) == Load(depth=1.0)
    assert load_of({"depth": 1.0, "shear": 1.0}).friction == "stick"
    assert load_of({"depth": 1.0, "shear": 1.0, "friction": 0.3}).friction == 0.3
    assert load_of({"grip": 1.0, "shear": 1.0}).friction == "none"
    assert load_of({"depth": 1.0, "plate_tilt": 180 / np.pi * 0.1}).plate_tilt == pytest.approx(0.1)


def test_only_the_last_values_are_kept():
    recent = Recent(2)
    made = []

    def make(key):
        return recent.get(key, lambda: made.append(key) or key)

    assert [make(key) for key in "abacb"] == list("abacb")
    assert made == ["a", "b", "c"]
    make("a")
    assert made == ["a", "b", "c", "a"]
