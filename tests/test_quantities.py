"""What a new quantity costs: a row, and for a stored one an attribute of the facts; everything else follows."""

import dataclasses
import io
import json
import re

import numpy as np
import pandas as pd
import pytest

import magtip
from fem import solution
from fem.results import diagnostics
from studies import quantities
from studies.answers import Answers
from studies.inputs.study_input import AXES, checked_quantities, needs_load
from studies.mechanics.path_solver import lacks
from studies.mechanics.store import State
from studies.quantities import QUANTITIES, Part, Quantity, stored_values
from studies.simulation import state_rows
from studies.sweeps.answer_plot import plot

PRESSES = pd.DataFrame({"L_mm": [9.0, 11.0], "E_MPa": [0.5, 1.3], "depth_mm": 0.5})
WORK = Quantity(
    "work",
    (Part("work", "mJ", "work of a linear press", estimate="force"),),
    derive=lambda of: of["force_N"] * of["depth_mm"] / 2,
)


@pytest.fixture
def with_work(monkeypatch):
    monkeypatch.setitem(QUANTITIES, WORK.name, WORK)


def test_a_derived_quantity_is_a_row(with_work):
    answers = magtip.answer(PRESSES, ["surrogate", "finite"], quantities=["force", "work"])
    for model in ("surrogate", "analytic"):
        expected = answers[f"{model}_force_N"] * PRESSES["depth_mm"] / 2
        assert answers[f"{model}_work_mJ"].to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-15)
    assert "work" in quantities.choice()
    assert checked_quantities(["work"]) == ("work",)
    with pytest.raises(magtip.BadInput, match="work"):
        checked_quantities(["wrok"])


def test_a_derived_quantity_has_an_axis_title_and_a_figure(with_work):
    answers = magtip.answer(PRESSES, ["surrogate", "finite"], quantities=["work"])
    chart = plot(answers, x="L_mm", y="work_mJ").to_dict()
    assert "work of a linear press (mJ)" in json.dumps(chart)


def test_a_derived_quantity_is_in_every_output_of_a_sweep(with_work, tmp_path, run):
    words = ["sweep", "paper", "--axis", "L=9,11", "--depth", "0.5", "--models", "surrogate,finite", "--quantities"]
    code, out, _ = run(*words, "work", "--json")
    assert code == 0
    assert json.loads(out.splitlines()[0])["surrogate_work_mJ"] > 0
    code, out, _ = run(*words, "work", "--out", str(tmp_path / "sweep"))
    assert code == 0
    assert {"work", "(mJ)"} <= set(out.split())
    assert "analytic_work_mJ" in pd.read_csv(tmp_path / "sweep" / "sweep.csv")
    assert (tmp_path / "sweep" / "sweep.png").exists()


def test_the_help_names_all_quantities(run):
    assert quantities.choice() in " ".join(re.sub(r"[│\s]+", " ", run("sweep", "--help")[1]).split())


def test_a_stored_quantity_is_an_attribute_and_a_row(monkeypatch, tmp_path):
    """It is in sweeps and in `solve` with its unit, and states that are kept without it are solved again."""
    of_facts = Quantity("load_number", (Part("load_number", "MPa", "a load", stored="load_number", scale=(1, 0)),))

    @dataclasses.dataclass(frozen=True)
    class Facts(solution.Facts):
        load_number: float | None = 0.25

    presses, store = PRESSES.assign(E_MPa=[0.5, 1.0]), tmp_path / "states.db"
    before = magtip.answer(presses, ["fem:quick"], quantities=["force"], store=store)
    monkeypatch.setitem(QUANTITIES, of_facts.name, of_facts)
    monkeypatch.setattr(diagnostics, "Facts", Facts)
    after = magtip.answer(presses, ["fem:quick"], quantities=["force", "load_number"], store=store)
    assert after["fem_load_number_MPa"].tolist() == [0.125, 0.25]
    assert after["fem_force_N"].to_numpy() == pytest.approx(before["fem_force_N"].to_numpy(), rel=1e-10)
    state = magtip.solve(magtip.paper(E=2.0), depth=0.1, accuracy="quick")
    assert state_rows.solved_row(magtip.paper(E=2.0), "rigid", state)["load_number_MPa"] == 0.5


def test_stored_values_have_bars_in_charts():
    table = pd.DataFrame({"fem_contact_pressure_MPa": [0.5], "fem_contact_pressure_error_estimate": [0.02]})
    answers = Answers.of_table(table.assign(fem_force_N=4.0, error_estimate=0.01, status="ok"))
    assert answers.half_widths("fem", "contact_pressure").tolist() == [[0.01]]
    assert answers.half_widths("fem", "force").tolist() == [[0.04]]


def test_answers_are_tidy_with_half_widths_and_errors(with_work):
    """The long form holds what the wide one does, of rows that are chosen and of a table from a file too."""
    presses = PRESSES.assign(shear_mm=[0.3, 0.0], specimen=["a", "b"]).set_axis(["first", "second"])
    names = ["force", "shift", "work", "strain", "readings"]
    answers = magtip.answer(presses, ["surrogate", "finite"], quantities=names, reference="finite")
    file = pd.read_csv(io.StringIO(answers.to_csv(index=False)))
    for table, label in ((answers, "second"), (answers.iloc[1:], "second"), (file, 1)):
        tidy = magtip.tidy(table)
        row = tidy[(tidy.model == "surrogate") & (tidy.part == "force")].loc[label]
        wide = answers.loc["second"]
        assert (row.value, row.unit, row.status) == (pytest.approx(wide.surrogate_force_N, rel=1e-12), "N", "ok")
        assert row.half_width == pytest.approx(wide.error_estimate * wide.surrogate_force_N, rel=1e-6)
    tidy = magtip.tidy(answers)
    assert set(tidy.quantity) == set(names)
    errors = tidy[(tidy.model == "surrogate") & (tidy.part == "force")].error_percent
    assert errors.tolist() == answers.force_error_percent.tolist()
    assert tidy[tidy.model == "finite"].half_width.isna().all()
    field = tidy[(tidy.part == "S2") & (tidy.model == "surrogate") & (tidy.unit == "mT")]
    assert field.value.tolist() == answers.surrogate_S2_mT.tolist()
    joined = magtip.tidy(answers).join(answers[["L_mm", "specimen"]])
    assert joined.groupby("specimen").L_mm.unique().tolist() == [[9.0], [11.0]]
    with pytest.raises(magtip.BadInput, match="no column status"):
        magtip.tidy(presses)


def test_errors_mirror_when_the_reference_is_exchanged():
    """1 + e of one model by the other is the inverse of that of the other one by it."""
    models, presses = ("surrogate", "finite"), PRESSES.assign(shear_mm=0.3)
    tables = {name: magtip.answer(presses, models, reference=name) for name in models}
    first = Answers.of_table(tables["finite"]).errors()["surrogate", "force"][:, :2]
    second = Answers.of_table(tables["surrogate"]).errors()["finite", "force"][:, :2]
    assert (1 + first / 100) * (1 + second / 100) == pytest.approx(1)


def test_states_without_a_value_lack_it():
    state = State(0.1, 0.0, "ok", "ok", {"values": {"largest_strain": 0.1}}, 0.0, "")
    assert not lacks(state, stored_values(["strain", "critical_depth"]))
    assert lacks(state, stored_values(["strain", "sideways_stiffness"]))
    assert not lacks(dataclasses.replace(state, outcome="failed"), ["anything"])


def test_stored_values_are_facts():
    names = {field.name for field in dataclasses.fields(solution.Facts)}
    assert set(stored_values(QUANTITIES)) <= names
    halves = {part.half_width for each in QUANTITIES.values() if not each.path for part in each.parts}
    assert halves - {""} <= names


def test_estimates_are_those_of_the_finite_elements():
    names = {field.name for field in dataclasses.fields(solution.Estimates)}
    assert {part.estimate for each in QUANTITIES.values() for part in each.parts} - {""} <= names


def test_columns_are_unique_and_units_are_known():
    parts = [part for each in QUANTITIES.values() for part in each.parts]
    columns = [part.column for part in parts]
    assert len(set(columns)) == len(columns)
    assert {part.unit for part in parts} | {field.unit for field in AXES.values()} <= set(quantities.UNITS)


def test_scaling_is_by_powers_of_modulus_and_diameter():
    part = Part("energy", "mJ", "energy", stored="energy", scale=(1, 3), factor=2.0)
    E, D = np.array([0.5, 2.0]), np.array([8.0, 10.0])
    assert part.scaled(np.array([0.1, 0.2]), E, D).tolist() == [2 * 0.1 * 0.5 * 8.0**3, 2 * 0.2 * 2.0 * 10.0**3]


def test_only_the_sensor_s_own_quantities_need_no_load():
    assert [needs_load(names) for names in (["critical_depth", "modes"], ["modes", "stiffness"], [])] == [
        False,
        True,
        True,
    ]


@pytest.mark.parametrize(
    ("quantity", "model"),
    [
        ("contact_pressure", "surrogate"),
        ("sideways_stiffness", "surrogate"),
        ("critical_depth", "surrogate"),
        ("strain", "paper"),
    ],
)
def test_a_quantity_that_no_model_answers_is_refused(quantity, model):
    with pytest.raises(magtip.BadInput, match=f"quantity {quantity} needs finite elements"):
        magtip.answer(PRESSES, [model], quantities=[quantity])
