"""The rule that chooses a model for a tolerance."""

import dataclasses
import json

import pytest

from analytic import beam, buckling
from fem.physics_version import PHYSICS
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics import model_choice, surrogate_response
from studies.mechanics.model_choice import Choice, Statement, choose, region, statements, unmet

PRESS, SHEAR = Load(depth=0.4), Load(depth=0.8, shear_x=0.8, friction="stick")
RUB, TILTED = Load(depth=0.8, shear_x=0.8, friction=0.4), Load(depth=0.8, plate_tilt=0.1)
TOLERANCES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)

WITHOUT = [each for each in statements() if each.model != "surrogate"]
"""The rule as it is without statements about the surrogate."""
PLACES = (
    ("press", "depth to 0.06 D"),
    ("press", "depth to D/4"),
    ("press", "deep"),
    ("glued shear", "shear to 0.15 D"),
)
RULE = [
    *WITHOUT,
    *(Statement(*place, "surrogate", "shipped", 9, 9, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02) for place in PLACES),
]
"""The rule with bounds of 2 % for the surrogate."""
STUBBY = Design(L=8.0, l0=6.0, magnet_diameter=4.8, magnet_height=2.8)
"""L/D 1 and a large magnet: outside the range of the formulas."""


def allowed(load, **options):
    """The choices for all tolerances that are met, from the largest to the smallest."""
    choices = []
    for tolerance in reversed(TOLERANCES):
        try:
            choices.append(choose(paper(), [load], tolerance, **options))
        except BadInput:
            break
    return choices


@pytest.mark.parametrize("load", [PRESS, SHEAR, RUB])
def test_a_smaller_tolerance_never_chooses_a_less_accurate_model(load):
    choices = allowed(load)
    assert len(choices) >= 4
    bounds = [choice.bound for choice in choices]
    assert bounds == sorted(bounds, reverse=True)


@pytest.mark.parametrize("load", [PRESS, SHEAR, RUB])
def test_the_bound_of_a_choice_meets_the_tolerance(load):
    assert all(choice.bound <= t for choice, t in zip(allowed(load), reversed(TOLERANCES), strict=False))


@pytest.mark.parametrize(
    ("case", "options", "name"),
    [
        ((paper(), [PRESS], 0.2), {}, "formula finite"),
        ((Design(L=7.0, l0=6.0), [PRESS], 0.2), {}, "surrogate"),
        ((paper(), [PRESS], 0.2, "ignored"), {}, "axisymmetric"),
        ((paper(), [PRESS], 0.2), {"formulas": False}, "axisymmetric"),
        ((paper(), [SHEAR], 0.3), {"formulas": False}, "harmonic"),
        ((paper(), [RUB], 0.3), {"formulas": False}, "harmonic"),
        ((paper(), [TILTED], 0.3), {"formulas": False}, "harmonic"),
        ((paper(), [PRESS], 0.2), {"rule": RULE}, "formula"),
        ((paper(), [PRESS], 0.05), {"rule": RULE}, "surrogate"),
        # a deformed body, and a rule that says nothing of the surrogate
        ((STUBBY, [PRESS], 0.05), {"rule": RULE, "formulas": False}, "axisymmetric"),
        ((STUBBY, [PRESS], 0.05), {"rule": WITHOUT}, "axisymmetric"),
        # outside the range of the surrogate
        ((dataclasses.replace(STUBBY, law="mooney-rivlin", mooney_share=0.2), [PRESS], 0.3), {"rule": RULE}, "axi"),
        ((dataclasses.replace(STUBBY, nu=0.44), [PRESS], 0.3), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [PRESS], 0.3, "ignored"), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [Load(depth=0.05)], 0.3), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [PRESS, Load(depth=0.05)], 0.3), {"rule": RULE}, "axisymmetric"),
        ((STUBBY, [TILTED], 0.3), {"rule": RULE}, "harmonic"),
        ((STUBBY, [RUB], 0.3), {"rule": RULE}, "harmonic"),
    ],
)
def test_the_cheapest_model_that_knows_the_case_is_chosen(case, options, name):
    assert choose(*case, **options).name.startswith(name)


def test_the_hardest_load_of_a_path_decides():
    far = dataclasses.replace(SHEAR, shear_x=2.4)
    bounds = [choose(paper(), [load], 0.3, formulas=False).bound for load in (SHEAR, far)]
    assert choose(paper(), [SHEAR, far], 0.3, formulas=False).bound == max(bounds)


def test_a_tolerance_that_no_model_meets_is_refused_with_the_smallest_one_that_is_met():
    with pytest.raises(BadInput, match=r"smallest tolerance that is met is 0\.\d+ %, by model axisymmetric fine"):
        choose(paper(), [PRESS], 1e-5)


def test_the_tolerance_that_a_refusal_names_is_met():
    with pytest.raises(BadInput) as refusal:
        choose(paper(), [SHEAR], 1e-5)
    least = float(str(refusal.value).split(" is met is ")[1].split(" %")[0]) / 100
    assert choose(paper(), [SHEAR], least).bound <= least


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -0.1, float("nan")])
def test_a_tolerance_outside_0_to_1_is_refused(tolerance):
    with pytest.raises(BadInput, match="between 0 and 1"):
        choose(paper(), [PRESS], tolerance)


@pytest.mark.parametrize(
    ("load", "words"),
    [(Load(grip=1.0, shear_x=0.5), "grips"), (TILTED, "tilted plates"), (Load(depth=0.01), "depths below 0.01 D")],
)
def test_bounds_grow_beyond_the_study(load, words):
    place = region(paper(), load, "rigid")
    assert words in place.beyond
    assert place.growth > 1
    assert words in choose(paper(), [load], 0.5, formulas=False).reason


def test_every_kind_has_statements_of_all_three_accuracies():
    levels = {(each.kind, each.level) for each in statements() if each.model != "formula"}
    kinds = ("press", "glued shear")
    assert {(kind, level) for kind in kinds for level in ("quick", "standard", "fine")} <= levels
    assert {("friction", level) for level in ("quick", "standard")} <= levels


def test_the_shipped_rule_is_that_of_the_committed_results():
    results = model_choice.DATA.parents[2] / "results" / "trade" / "model_choice.json"
    assert model_choice.DATA.read_text("utf-8") == results.read_text("utf-8")


def test_the_shipped_rule_is_of_the_versions_of_today():
    """Fails when a model's answers have changed: then `magtip validate trade --confirm` must be made again."""
    assert model_choice.outdated() == ()
    assert len(statements()) == len(json.loads(model_choice.DATA.read_text("utf-8"))["statements"])


@pytest.fixture
def fresh():
    """Let the rule be read again, before and after a test."""
    cached = model_choice.statements, model_choice.outdated, model_choice.versions
    for function in cached:
        function.cache_clear()
    yield
    for function in cached:
        function.cache_clear()


@pytest.mark.usefixtures("fresh")
def test_statements_of_another_version_of_the_physics_do_not_count(monkeypatch):
    monkeypatch.setitem(PHYSICS, "harmonic", PHYSICS["harmonic"] + 1)
    assert model_choice.outdated() == ("harmonic",)
    assert {each.kind for each in statements()} == {"press"}
    assert "harmonic" not in {each.model for each in statements()}
    press = choose(paper(), [PRESS], 0.01, formulas=False)
    assert (press.model, "other versions of harmonic, which are left out" in press.reason) == ("axisymmetric", True)
    with pytest.raises(
        BadInput, match="no run of model harmonic for glued shear, and those of harmonic are of another"
    ):
        choose(paper(), [SHEAR], 0.01)


@pytest.mark.usefixtures("fresh")
def test_a_formula_with_other_answers_does_not_count(monkeypatch):
    original = beam.solve
    monkeypatch.setattr(beam, "solve", lambda *case: original(*case).scaled(1.0, 1.001))
    assert model_choice.outdated() == ("formula",)
    assert "formula" not in {each.model for each in statements()}


@pytest.mark.parametrize("load", [PRESS, Load(depth=1.0), SHEAR])
def test_the_surrogate_is_chosen_between_formulas_and_finite_elements(load):
    # the half widths of the shear are 5 to 10 %: the interval is one of nine beams out of ten at all loads
    choice = choose(STUBBY, [load], 0.15, rule=RULE)
    assert (choice.model_kind, choice.name) == ("surrogate", "surrogate shipped")
    assert "90 % intervals" in choice.reason
    assert choose(STUBBY, [load], 0.015, rule=RULE).model_kind == "fem"


def test_the_half_widths_of_the_surrogate_must_meet_the_tolerance_too():
    small = {"force": 1e-6, "shift": 1e-6, "tilt": None, "readings": 1e-6, "sideways": None}
    exact = [dataclasses.replace(each, **small) for each in RULE]
    only = [each for each in exact if each.model == "surrogate"]
    widths = surrogate_response.respond(STUBBY, PRESS)
    widest = max(widths.errors["force"], widths.errors["shift"])
    assert choose(STUBBY, [PRESS], 0.5, rule=only).bound == pytest.approx(widest)
    with pytest.raises(BadInput, match="by model surrogate shipped"):
        choose(STUBBY, [PRESS], 0.9 * widest, rule=only)


def test_a_press_that_may_buckle_is_left_to_finite_elements():
    slender = Design(L=30.0, l0=28.2, magnet_diameter=4.0, magnet_height=2.0)
    critical = surrogate_response.beams_of([slender]).critical_depth()
    depth = 8.0 * float(critical.value[0])
    assert 0 < depth < 2.9
    assert choose(slender, [Load(depth=depth)], 0.05, rule=RULE).model_kind == "fem"
    assert choose(slender, [Load(depth=0.7 * depth)], 0.05, rule=RULE).model_kind == "surrogate"


def test_the_surrogate_has_no_bound_where_the_force_along_the_shear_was_not_measured():
    unknown = [dataclasses.replace(each, sideways=None) for each in RULE]
    assert choose(STUBBY, [SHEAR], 0.15, rule=RULE).model_kind == "surrogate"
    assert choose(STUBBY, [SHEAR], 0.05, rule=unknown).model_kind == "fem"


CHOICE = Choice("fem", "standard", "harmonic", 0.004, "", 0.002, 0.005)
ESTIMATES = {"force": 0.001, "shift": 0.001, "tilt": 0.001, "sideways": 0.001}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, ""),
        ({"sideways": 0.0094}, "error estimate of the force along the shear, 0.94 %, exceeds the tolerance 0.5 %"),
        ({"tilt": 0.006}, "error estimate of the tilt, 0.6 %, exceeds"),
        *(({name: None}, "is unknown") for name in ESTIMATES),
        ({"force": float("nan")}, "the error estimate of the force is unknown"),
    ],
)
def test_an_estimate_beyond_the_tolerance_or_unknown_does_not_meet_it(changed, words):
    along = buckling.sideways_stiffness(paper()) * SHEAR.shear_x
    reason = unmet(CHOICE, paper(), SHEAR, along, ESTIMATES | changed)
    assert words in reason
    assert bool(words) == bool(reason)


def test_a_press_needs_no_estimate_of_tilt_or_force_along_a_shear():
    assert unmet(CHOICE, paper(), PRESS, None, {"force": 0.001, "shift": 0.001}) == ""


@pytest.mark.parametrize(("share", "met"), [(1.0, True), (0.5, True), (0.3, False), (0.001, False), (0.0, False)])
def test_the_bound_of_a_force_along_the_shear_grows_as_it_vanishes(share, met):
    along = share * buckling.sideways_stiffness(paper()) * SHEAR.shear_x
    assert (unmet(CHOICE, paper(), SHEAR, along, ESTIMATES) == "") is met
    assert unmet(CHOICE, paper(), SHEAR, None, ESTIMATES)
