"""What a change costs: in a copy of the product two fields, a quantity, a model, a verb, a study of validation, a
criterion of sizing and a panel of the live page are added, each where it is declared and nowhere else; columns, JSON,
headings, titles, controls, help, margins, yield and pages follow."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("geometry", "analytic", "fem", "studies", "magtip")
CRITERION = """    squeeze: float | None = _number(
        "mm", 0.01, 9.0, "depth under the press", '"2 mm"',
        criterion=at_most("deepest press", lambda of, needed: of["depth"] * of["D"]))
"""
DECLARED = {
    "geometry/design.py": (
        "\n    def __post_init__(self) -> None:\n        # a sweep",
        '    pad: float = quantity(1.0, "mm", 0.0, 9.0, "thickness of a pad", assumed=True, later=True)\n',
    ),
    "geometry/loads.py": (
        "\n    def __post_init__(self) -> None:\n        for spec",
        '    lift: float = _of_load(0.0, "N", "dead force along z", low=0.0, slider=(0.0, 2.0))\n',
    ),
    "studies/quantities.py": (
        '    Quantity("readings"',
        '    Quantity("sag", (Part("sag", "mm", "sag of a pad"),), derive=lambda x: x["force_N"] / x["pad_mm"]),\n',
    ),
    "studies/parts/requirements.py": (
        "    D_low: float | None",
        CRITERION,
    ),
    "studies/web/panels.py": (
        '    Panel("vibration"',
        '    Panel("slenderness", "Slenderness", "slenderness.ratio", width=12),\n',
    ),
}
"""Files of the product, each with the text before which something is declared, and its declaration."""
VERB = '''

@verb("source sets as_json")
def length(call: Call) -> int:
    """Print the length of the beam."""
    design = call.design()
    return show(Result(title="Length", records=[{"length_mm": design.L}]), call.screen)
'''
STUDY = '''"""A study that counts."""

from studies.output.goals import Goal
from studies.validation import pages

FILES = ("PADS.md", "pads.csv")


def run(progress, *, quick: bool = False, pads: int = 3):
    """Count pads.

    Parameters
    ----------
    quick
        Count fewer.
    pads
        Number of pads that are counted.
    """
    rows = [{"pad": k, "thickness_mm": 0.5 * k} for k in range(pads)]
    return pages.study("pads", "Pads", rows, {"rows": rows}, goals=[Goal("pads", len(rows), pads, pads)])
'''
MODEL = '''"""A spring that is as stiff as it is long, as a model."""

from dataclasses import dataclass

from geometry.loads import Response
from studies.mechanics.path_solver import NAN, Answer, impossible
from studies.mechanics.model import Model


@dataclass(frozen=True, slots=True)
class Spring(Model):
    names = ("spring",)
    words = "a spring"
    columns = {"turns": NAN, "wire": ""}

    def answers(self, problems, found, kind="states"):
        return [self._answer(each.design, each.load, each.message) for each in problems]

    def _answer(self, design, load, message):
        if design is None:
            return impossible(message)
        pressed = Response((0.0, 0.0, design.L * load.depth), (0.0, 0.0, -load.depth), 0.0, 0.0)
        made = {"turns": design.L / design.D, "wire": "steel"}
        return Answer(design.D, design.E, pressed, "ok", "of a spring", NAN, 0.0, columns=made)
'''
PANEL = '''"""The panel `slenderness`."""

from studies.web.state_answers import number


def ratio(request, level, memory):
    design = request.state.design
    yield level, {"columns": ["", ""], "rows": [number("L over D", "", design.L / design.D)], "message": ""}
'''
SIZED = """
import dataclasses
import numpy as np
from studies.parts.catalogues import catalogues_of
from studies.parts.requirements import read_requirements
from studies.sizing import conflicts, front_solves, front_yield, sizing_study
from studies.web import required_margins

design, needed = required_margins.sensor_of("fingertip")
needed = dataclasses.replace(needed, squeeze=2.0)
variant, reached = required_margins.variant_of(design, needed), required_margins.performance_of(design, needed)
values = reached.one(0) | {f"{name}_half_width": 0.0 for name in front_solves.COMPARED}
margins = {name: float(margin[0]) for name, margin in reached.margins.items()}
point = front_solves.FrontPoint(1, variant, values, values, margins, [], "ok", "", 1, 1.0)
sizing = sizing_study.Sizing(needed, catalogues_of(needed), sizing_study.Settings(), 1, 1, [point], None, None)
shares = front_yield.shares_of(variant, needed, 8, intervals=False)
gives = {"requirement": "squeeze", "value": 2.0, "gives": 0.5, "to": 2.5, "advice": 1}
sized = {
    "file": read_requirements("needed.toml").squeeze, "margins": margins, "depth": values["depth"] * design.D,
    "row": list(point.row()), "page": sizing_study.page(sizing), "yield": list(shares.table.requirement),
    "conflict": conflicts.Conflict((), 1, advices=(gives,)).sentence(),
    "live": [row["name"] for row in required_margins.margins(design, needed)["rows"]],
}
"""
PAGE = '# Pads\n\n{{ verdict }}\n\n{{ rows | table(dict(pad="pad", thickness_mm="thickness (mm)")) }}\n'
ASKED = """
import contextlib, io, json
import pandas as pd
import magtip
from geometry import design_digest
from geometry.design import Design
from studies.cli import commands
from studies.mechanics import store
from studies.web.explorer_answers import Answers
from studies.web.explorer_state import explorer_fields, request_of, state_of
from studies.web.page_content import explorer_page
from studies.web.state_answers import numbers
from studies.web.state_exports import shell

def said(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out:
        status = commands.run(list(words))
    return status, out.getvalue()

cases = pd.DataFrame({"pad_mm": [1.0, 2.0], "lift_N": 0.5, "depth_mm": 0.5})
answers = magtip.answer(cases, ["spring"], quantities=["force", "sag"])
sprung = magtip.answer(pd.DataFrame({"L_mm": [9.0, 12.0, 1.0], "depth_mm": 0.5}), ["finite", "spring"],
                       reference="spring", quantities=["force", "stiffness", "sag"])
try:
    magtip.answer(cases, ["sprung"])
except magtip.BadInput as error:
    unknown = str(error)
refused = magtip.answer(cases.assign(pad_mm=[1.0, 10.0], lift_N=[-1.0, 0.5]), ["finite"], quantities=["force"])
sweep = ("sweep", "paper", "--axis", "pad=1,2", "--axis", "lift=0,0.5", "--depth", "0.5", "--models", "finite,spring",
         "--quantities", "force,sag")
asked = {"parts": ["slenderness"], "state": {"level": "quick", "design": {"L": 12}}}
with store.opened(None) as kept:
    panel = [answer for answer in Answers(kept).all_of(request_of(asked), "quick") if answer]
lifted = ("solve", "paper", "--lift", "0.25", "--accuracy", "quick")
print("RESULT" + json.dumps({
    "answers": list(answers), "refused": list(refused.message),
    "beyond": list(magtip.answer(cases, ["finite", "surrogate"], quantities=["force"]).message),
    "chart": magtip.plot(answers, x="pad_mm", y="force_N").to_dict(),
    "loads": magtip.plot(answers.assign(lift_N=[0.0, 0.5]), x="lift_N", y="force_N").to_dict(),
    "json": said(*sweep, "--json"), "files": said(*sweep, "--out", "swept"), "help": said("sweep", "--help"),
    "tidy": magtip.tidy(sprung).to_dict("list"), "sprung": sprung.to_dict("list"), "unknown": unknown,
    "sags": magtip.plot(answers, x="pad_mm", y="sag_mm").to_dict(), "parts": sorted(set(magtip.tidy(answers).part)),
    "models": magtip.plot(sprung.iloc[:2], x="L_mm", y="force_N").to_dict(),
    "values": said("design", "paper", "--set", "pad=2"),
    "controls": {field["name"]: field for field in explorer_fields(Design(pad=3.0))},
    "solve": said("solve", "--help"), "state": said(*lifted, "--depth", "0.3", "--json"),
    "upright": said(*lifted, "--depth", "0.3"),
    "states": said(*lifted, "--depths", "0.3,0.4"), "low": said(*lifted[:3], "-1", "--depth", "0.3"),
    "page": numbers(state_of({"load": {"depth": 0.1}}), magtip.solve(Design(), magtip.Load(0.1), "quick"), None),
    "shell": shell(state_of({"load": {"depth": 1, "lift": 0.5}})),
    "label": design_digest.label({"pad_mm": 1.0, "D_mm": 8.0})["made_for"],
    "verbs": said("--help"), "verb": said("length", "paper", "--set", "L=11", "--json"),
    "list": said("validate", "verify", "--help"), "example": said("size", "--example"), "sized": sized,
    "panel": panel, "html": explorer_page(), "offline": explorer_page(offline=True),
    "study": said("validate", "verify", "pads", "--pads", "2", "--out", "pages"),
}))
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """Return a folder with the changed product, whose other files are links, and what it says."""
    folder = tmp_path_factory.mktemp("product")
    for package in PACKAGES:
        # with what is compiled
        shutil.copytree(ROOT / package, folder / package, copy_function=os.symlink)
    for name, (mark, line) in DECLARED.items():
        text = (ROOT / name).read_text("utf-8")
        assert text.count(mark) == 1
        (folder / name).unlink()
        (folder / name).write_text(text.replace(mark, line + mark), "utf-8")
    commands = folder / "studies/cli/design_commands.py"
    text = commands.read_text("utf-8")
    commands.unlink()
    commands.write_text(text + VERB, "utf-8")
    (folder / "studies/models/spring.py").write_text(MODEL, "utf-8")
    (folder / "studies/validation/verify/pads.py").write_text(STUDY, "utf-8")
    (folder / "studies/validation/templates/pads.md.j2").write_text(PAGE, "utf-8")
    (folder / "studies/web/slenderness.py").write_text(PANEL, "utf-8")
    (folder / "needed.toml").write_text('force_z = 5\nsqueeze = "0.2 cm"\n', "utf-8")
    env = {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "200"}
    done = subprocess.run([sys.executable, "-c", SIZED + ASKED], cwd=folder, env=env, capture_output=True, text=True)
    assert "RESULT" in done.stdout, done.stderr
    return folder, json.loads(done.stdout.rpartition("RESULT")[2])


def test_a_field_has_its_column_in_answers_with_its_unit_and_its_bounds(copy):
    _, found = copy
    assert {"pad_mm", "lift_N"} <= {*found["answers"]}
    assert "lift_N must be at least 0 N; got -1" in found["refused"][0]
    assert "pad_mm must lie between 0 and 9 mm; got 10" in found["refused"][1]


def test_a_field_is_in_the_csv_file_the_json_and_the_headings_of_a_sweep(copy):
    folder, found = copy
    head = (folder / "swept" / "sweep.csv").read_text("utf-8").splitlines()[0].split(",")
    assert {"pad_mm", "lift_N"} <= {*head}
    assert {"pad_mm": 2.0, "lift_N": 0.5}.items() <= json.loads(found["json"][1].splitlines()[-1]).items()
    assert {"pad", "lift", "(mm)", "(N)"} <= {*found["files"][1].split()}
    assert found["json"][0] == found["files"][0] == 0
    assert (folder / "swept" / "sweep.png").exists()


def test_a_field_has_a_title_of_an_axis(copy):
    _, found = copy
    assert "pad (mm)" in json.dumps(found["chart"])
    assert "lift (N)" in json.dumps(found["loads"])


def test_a_field_is_in_the_list_of_a_design_with_its_words(copy):
    _, found = copy
    (row,) = (line.split() for line in found["values"][1].splitlines() if line.startswith("pad "))
    assert row == ["pad", "2", "mm", "changed", "thickness", "of", "a", "pad"]


def test_a_field_of_a_load_is_named_by_the_help_of_axes(copy):
    _, found = copy
    assert "imperfection, lift" in " ".join(found["help"][1].replace("│", " ").split())


def test_a_field_has_a_control_on_the_page(copy):
    _, found = copy
    control = found["controls"]["pad"]
    assert control["help"] == "thickness of a pad"
    assert (control["label"], control["kind"], control["unit"], control["value"]) == ("Pad", "number", "mm", 3.0)
    assert (control["slider"], control["step"], control["low"], control["high"]) == ([0.0, 9.0], 0.09, 0.0, 9.0)


def test_a_field_of_a_load_is_an_option_and_a_column_of_solve(copy):
    _, found = copy
    assert "--lift FLOAT Dead force along z, N." in " ".join(found["solve"][1].replace("│", " ").split())
    assert found["state"][0] == found["states"][0] == 0
    assert json.loads(found["state"][1])["lift_N"] == 0.25
    assert {"lift", "0.25"} <= {*found["states"][1].split()}
    assert found["low"][0] == 2


def test_models_that_do_not_know_a_field_of_a_load_refuse_it(copy):
    _, found = copy
    assert "the formulas cannot model lift = 0.5 N" in found["beyond"][0]
    assert "the surrogate does not know lift = 0.5 N" in found["beyond"][0]


def test_a_field_of_a_load_has_a_control_on_the_page_and_acts_there(copy):
    _, found = copy
    control = found["controls"]["lift"]
    assert (control["scope"], control["group"], control["label"], control["unit"]) == ("load", "Load", "Lift", "N")
    assert (control["help"], control["kind"], control["slider"]) == ("dead force along z", "number", [0.0, 2.0])
    assert found["shell"] == "magtip solve paper --depth 1 --lift 0.5"


def test_a_field_at_its_default_changes_no_label_of_older_files(copy):
    _, found = copy
    assert found["label"] == {"D_mm": 8.0}


def test_a_verb_is_a_function(copy):
    _, found = copy
    assert "Print the length of the beam." in found["verbs"][1]
    assert found["verb"][0] == 0
    assert json.loads(found["verb"][1])["length_mm"] == 11.0


def test_a_derived_quantity_has_columns_headings_help_and_a_title(copy):
    folder, found = copy
    head = (folder / "swept" / "sweep.csv").read_text("utf-8").splitlines()[0].split(",")
    assert {"analytic_sag_mm", "spring_sag_mm"} <= {*head}
    last = json.loads(found["json"][1].splitlines()[-1])
    assert last["spring_sag_mm"] == last["spring_force_N"] / 2
    assert "sag" in found["files"][1].split()
    assert "stiffness, sag, readings" in " ".join(found["help"][1].replace("│", " ").split())
    assert "sag of a pad (mm)" in json.dumps(found["sags"])
    assert found["parts"] == ["force", "sag"]


def test_a_derived_quantity_is_in_the_json_and_the_table_of_solve_and_on_the_page(copy):
    _, found = copy
    state = json.loads(found["state"][1])
    assert state["sag_mm"] == state["force_N"][2]
    assert f"sag {state['sag_mm']:.5g} mm" in " ".join(found["upright"][1].split())
    table = {row["name"]: row for row in found["page"]["tables"]["response"]["rows"]}
    assert (table["sag"]["value"], table["sag"]["unit"]) == (table["normal force"]["value"], "mm")


def test_a_model_has_columns_status_and_errors_in_answers(copy):
    _, found = copy
    answers = found["sprung"]
    assert answers["spring_force_N"][:2] == [4.5, 6.0]
    assert answers["spring_stiffness_N_per_mm"][:2] == [9.0, 12.0]
    assert answers["spring_sag_mm"][:2] == answers["spring_force_N"][:2]
    assert answers["spring_status"] == answers["analytic_status"] == ["ok", "ok", "bad_input"]
    assert answers["turns"][:2] == [9 / 8, 12 / 8]
    assert answers["wire"] == ["steel", "steel", ""]
    short, long = answers["analytic_force_N"][:2]
    assert answers["force_error_percent"][:2] == pytest.approx([100 * (short / 4.5 - 1), 100 * (long / 6.0 - 1)])
    assert "of a spring" in answers["message"][0]
    assert found["unknown"] == "there is no model 'sprung': did you mean spring?"


def test_a_model_is_in_the_csv_file_the_json_the_headings_and_the_help_of_a_sweep(copy):
    folder, found = copy
    head = (folder / "swept" / "sweep.csv").read_text("utf-8").splitlines()[0].split(",")
    assert {"spring_force_N", "spring_status", "turns", "wire"} <= {*head}
    assert json.loads(found["json"][1].splitlines()[-1])["spring_force_N"] == 4.5
    assert {"spring", "wire", "steel"} <= {*found["files"][1].split()}
    assert "a spring (spring)" in " ".join(found["help"][1].replace("│", " ").split())


def test_a_model_is_in_the_tidy_table_and_in_the_legend_of_a_plot(copy):
    _, found = copy
    rows = zip(found["tidy"]["model"], found["tidy"]["quantity"], found["tidy"]["value"], strict=True)
    assert [value for model, quantity, value in rows if (model, quantity) == ("spring", "force")][:2] == [4.5, 6.0]
    assert "spring" in json.dumps(found["models"])


def test_a_study_of_validation_is_a_module_and_a_template(copy):
    folder, found = copy
    assert "pads" in found["list"][1]
    assert "Number of pads that are counted" in found["list"][1]
    assert found["study"][0] == 0
    assert "thickness (mm)" in (folder / "pages" / "PADS.md").read_text("utf-8")
    assert "pad,thickness_mm" in (folder / "pages" / "pads.csv").read_text("utf-8")


def test_a_criterion_is_a_key_of_requirements_with_its_unit_and_words(copy):
    _, found = copy
    assert 'squeeze = "2 mm"                   # depth under the press\n' in found["example"][1]
    assert found["sized"]["file"] == 2.0


def test_a_criterion_has_margins_columns_and_yield(copy):
    sized = copy[1]["sized"]
    assert sized["margins"]["squeeze"] == pytest.approx(1 - sized["depth"] / 2.0)
    assert "margin_squeeze_percent" in sized["row"]
    assert "squeeze" in sized["yield"]
    assert "deepest press, at most 2" in sized["live"]


def test_a_criterion_is_on_the_page_of_a_sizing_and_in_the_sentence_of_a_conflict(copy):
    sized = copy[1]["sized"]
    assert re.search(r"\| squeeze +\| 2 +\| mm +\| set +\| [\d.]+ +\|", sized["page"])
    assert f"; deepest press: {sized['depth']:.3g} mm" in sized["page"]
    assert "squeeze rises to 2.5 mm" in sized["conflict"]


def test_a_panel_is_a_section_of_the_page_whose_part_is_asked_for_and_answered(copy):
    _, found = copy
    (section,) = re.findall(r'<section [^>]*id="slenderness-panel".*?</section>', found["html"], re.S)
    assert 'class="panel span-12 compared-12"' in section
    assert 'data-part="slenderness"' in section
    assert "<h2>Slenderness</h2>" in section
    assert 'data-table="slenderness"' in section
    ((part, level, data),) = found["panel"]
    assert (part, level, data["rows"][0]["value"]) == ("slenderness", "quick", 1.5)
    assert "slenderness" not in found["offline"]
