"""A sweep as options and a study file ask for it: what is taken from where, and what contradicts what."""

import itertools
import math

import pytest

from fem.accuracy import FINE, QUICK, STANDARD
from geometry.design import paper
from studies.inputs.option_groups import Sweep
from studies.sweeps import sweep
from studies.sweeps.sweep import Shown


def asked(axis=None, sets=(), **more):
    return Sweep(axis=axis, **more), sets


def plan_of(source, options):
    return sweep.plan_of(source, *options)


def idle_axes(rows, plan, *, whole):
    shown = Shown(plan)
    shown.rows, shown.count = rows, len(rows)
    return sweep.idle_axes(shown, whole=whole)


STUDY = 'depth = 1\naccuracy = "fine"\nmagnet = "ignored"\n[axes]\nD = [3, 8]\n'


def test_a_study_file_gives_everything(toml):
    plan = plan_of(toml(STUDY, "study.toml"), asked(sets=["E=2"]))
    assert (plan.design.E, plan.load, plan.magnet, plan.count) == (2.0, {"depth": 1.0}, "ignored", 2)
    assert [model.accuracy for model in plan.fem] == [FINE]
    assert (plan.formulas, plan.quantities) == (("paper",), ("force", "shift", "contact_radius", "readings"))


def test_options_replace_the_values_of_a_study(toml):
    options = asked(depth=2.0, accuracy="quick", magnet="rigid", quantities="tilt,force")
    plan = plan_of(toml(STUDY, "study.toml"), options)
    assert (plan.load, plan.magnet, plan.quantities) == ({"depth": 2.0}, "rigid", ("force", "tilt"))
    assert [model.accuracy for model in plan.fem] == [QUICK]


def test_axes_vary_a_preset_or_a_file(toml):
    path = toml("D = 10\nL = 12\n", "sensor.toml")
    for options in (asked(["E=1,2", "depth=1"]), asked(["E=1,2", "depth=1"], design=path)):
        plan = plan_of(path if options[0].design is None else None, options)
        assert (plan.design.D, plan.axes, plan.count) == (10.0, ("E", "depth"), 2)
    assert plan_of(None, asked(["depth=1"])).design == paper()


def test_models_are_ordered_from_coarse_to_fine():
    plan = plan_of(None, asked(["depth=1"], models="half-quick,finite,standard,quick,paper"))
    assert [(model.name, model.model) for model in plan.fem] == [
        ("quick", "auto"),
        ("standard", "auto"),
        ("half-quick", "half"),
    ]
    assert plan.fem[1].accuracy == STANDARD
    assert plan.formulas == ("paper", "finite")


def test_a_load_to_the_side_adds_the_tilt():
    plan = plan_of(None, asked(["shear=0.5,1"], load=["depth=1", "friction=0.5"]))
    assert plan.load == {"depth": 1.0, "friction": 0.5}
    assert "tilt" in plan.quantities


def test_a_grip_needs_no_depth():
    assert plan_of(None, asked(["shear=1"], load=["grip=2"])).load == {"grip": 2.0}


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (asked(), ["a sweep needs at least one axis"]),
        (asked(["D=8"]), ["a sweep needs a depth"]),
        (asked(["D=8"], depth=-1.0), ["axis depth must be more than 0 mm; got -1"]),
        (asked(["D=8"], depth=1.0, sets=["D=9"]), ["D is both an axis and set to 9"]),
        (asked(["depth=1"], depth=1.0), ["depth is given twice"]),
        (asked(["depth=1"], load=["depth=2"]), ["depth is given twice, as an axis and by --load"]),
        (asked(["D=8"], depth=1.0, load=["depth=2"]), ["depth is given twice, by --depth and by --load"]),
        (asked(["depth=1"], models=""), ["there is no model ''"]),
        (asked(["depth=1"], quantities=""), ["there is no quantity ''"]),
        (asked(["depth=1"], load=["sheer=2"]), ["'sheer'", "did you mean shear"]),
        (asked(["magnet=rigid,ignored"], depth=1.0, magnet="rigid"), ["magnet is given twice"]),
        (asked(["depth=1"], accuracy="quick", models="standard"), ["models and accuracy both choose"]),
        (asked(["depth=1"], models="standrad"), ["there is no model 'standrad': did you mean standard?"]),
        (asked(["depth=1"], models="quick,quick"), ["model quick is given twice"]),
        (asked(["depth=1"], quantities="forces"), ["there is no quantity 'forces'"]),
        (asked(["depth=1"], tolerance="1%", accuracy="quick"), ["a tolerance chooses the accuracy"]),
        (asked(["depth=1"], tolerance="1%", models="quick"), ["a tolerance chooses the finite elements"]),
        (asked(["depth=1"], tolerance="200%"), ["--tolerance must be a percentage", "'200%'"]),
        (asked(["depth=1"], models="paper", quantities="modes"), ["quantity modes needs finite elements"]),
        (asked(["depth=1"], models="paper", quantities="response"), ["quantity response needs finite elements"]),
        (asked(["depth=1"], quantities="cycle"), ["quantity cycle needs the rate"]),
        (asked(["depth=1"], load=["frequency=2"]), ["frequency has no effect", "response"]),
        (asked(["depth=1"], load=["speed=2"], quantities="response"), ["speed has no effect"]),
        (
            asked(["speed=1,2"], depth=1.0, load=["frequency=2"], quantities="response"),
            ["leave one of them out"],
        ),
        (
            asked(["frequency=0,2"], depth=1.0, quantities="response"),
            ["frequency must be more than 0 Hz", "got 0"],
        ),
        (
            asked(["depth=1"], models="quick", quantities="decoded_force_error"),
            ["needs a level of the formulas"],
        ),
    ],
)
def test_contradictions_are_refused(options, parts, refused):
    with refused(*parts):
        plan_of(None, options)


def test_a_study_with_axes_of_its_own_takes_no_others(toml, refused):
    path = toml(STUDY, "study.toml")
    with refused("has its own axes"):
        plan_of(path, asked(["E=1"]))
    with refused("the design is given twice"):
        plan_of(path, asked(design="paper"))


def test_a_study_does_not_fix_the_magnet_that_it_varies(toml, refused):
    path = toml('magnet = "ignored"\ndepth = 1\n[axes]\nmagnet = ["rigid", "ignored"]\n', "study.toml")
    with refused("magnet is given twice, as an axis and alone in the study"):
        plan_of(path, asked())


def cases(axes, **figures):
    """Rows of a sweep whose figures are functions of the case."""
    names = {"D": "D_mm", "f": "f_mm", "E": "E_MPa", "depth": "depth_mm"}
    for point in itertools.product(*axes.values()):
        case = dict(zip(axes, point, strict=True))
        row = {"status": "ok", "solve": len(case), "seconds": sum(point), "fem_force_N": 1.0, "fem_S2_mT": math.nan}
        yield row | {names[name]: value for name, value in case.items()} | {k: v(case) for k, v in figures.items()}


def test_an_axis_that_changes_nothing_is_named():
    axes = {"D": [6.0, 8.0], "f": [5.0, 6.0], "E": [1.0]}
    rows = list(cases(axes, fem_force_N=lambda case: case["D"]))
    plan = plan_of(None, asked(["D=6,8", "f=5,6", "E=1"], depth=0.3))
    assert idle_axes(rows, plan, whole=True) == [("f", "the results are the same for all its values")]
    rows = list(cases(axes, fem_force_N=lambda case: case["D"], fem_S2_mT=lambda case: case["f"]))
    assert idle_axes(rows, plan, whole=True) == []
    assert idle_axes(rows, plan, whole=False) == [("f", "it changes only columns that --wide, --json and --out show")]
    # a single case tells nothing, nor do cases that failed
    assert idle_axes(rows[:1], plan, whole=True) == idle_axes([], plan, whole=True) == []
    failed = [row | {"status": "bad_input", "fem_S2_mT": 0.0} for row in rows]
    assert idle_axes(failed, plan, whole=True) == []
