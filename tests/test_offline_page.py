"""The explorer's page as one file: its JavaScript against Python, and the page in headless Chromium."""

import json
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from geometry.design import BadInput, Design, paper
from studies.explorer import offline_model, offline_page, offline_sections, state_commands
from studies.explorer.explorer_state import request_of
from studies.output import atomic_files

ROOT = Path(__file__).resolve().parent.parent
MOST_BYTES = 5e6
DESIGNS, LOADS = 40, 10
AGREEMENT = 1e-6
ENGINE = """
window.theModel = OfflineModel.load(OfflineData.decoded(MAGTIP_OFFLINE.model));
window.theAnswers = (cases, parts) => cases.map(({ state, formula_level }) => {
  try {
    const one = theModel.checked(state, formula_level);
    return Object.fromEntries(parts.map((name) => [name, name === "commands"
      ? StateCommands.commands(one, MAGTIP_OFFLINE.model.fields) : theModel[name + "Part"](one)]));
  } catch (error) {
    if (!(error instanceof BadInput)) throw error;
    return { error: error.message };
  }
});
true"""


@pytest.fixture(scope="module")
def sections():
    """Few sections of the paper's sensor."""
    return offline_sections.solve(paper(), depths=(0.01, 0.03, 0.125), shears=(0.0, 0.1))


@pytest.fixture(scope="module")
def file(sections, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "explorer.html"
    atomic_files.write_text(path, offline_page.page(paper(), offline_sections.data(paper(), sections)))
    return path


@pytest.fixture(scope="module")
def page(chromium, file):
    page = chromium.page(file)
    page.run(ENGINE)
    return page


@pytest.fixture(scope="module")
def cases():
    """Random states around and beyond the range of the surrogate: designs, each with several loads."""
    rng = np.random.default_rng(7)
    return [case for _ in range(DESIGNS) for case in random_cases(rng)]


def random_cases(rng):
    D = rng.uniform(4, 20)
    d, h = D * rng.uniform(0.19, 0.65, 2)
    L = D * rng.uniform(max(0.74, 0.6 + h / D / 2), 4.1)
    design = {
        "D": D,
        "L": L,
        "magnet_diameter": d,
        "magnet_height": h,
        "l0": max(h / 2, L - D / 2) + rng.uniform(0.5, 6),
        "E": rng.uniform(0.05, 3),
        "nu": rng.uniform(0.449, 0.4999),
        "magnet_edge_radius": 0.15 * rng.random() * min(d, h),
        "remanence": rng.uniform(0.8, 1.4),
        "magnet_north": str(rng.choice(["down", "up"])),
        "f": D * rng.uniform(0.3, 1),
        "c": rng.uniform(-1, 3),
        "chip_x": rng.uniform(-3, 3),
        "hall_layout": str(rng.choice(["three", "three", "tmag5273a1"])),
        "hall_step": float(rng.choice([0, 0.0012])),
        "hall_plate": float(rng.choice([0, 0.5])),
        "hall_noise": float(rng.choice([0, 1e-3])),
        "hall_average": 16,
    }
    for _ in range(LOADS):
        load = {
            "depth": D * rng.uniform(0.005, min(0.38, 0.42 * (L - h) / D)),
            "shear": D * rng.uniform(-0.36, 0.36),
            "direction": float(rng.choice([0, 90, rng.uniform(-180, 180)])),
            "friction": [*["stick"] * 6, "none", "none", 0.3][rng.integers(9)],
            "plate_tilt": 5.0 if rng.random() < 0.02 else 0.0,
        }
        yield {
            "number": 1,
            "state": {"preset": "paper", "design": design, "load": load, "magnet": "rigid"},
            "formula_level": str(rng.choice(["paper", "column", "tip", "magnet", "finite"])),
        }


def by_python(case, parts):
    functions = {
        "state": offline_model.state_part,
        "curve": offline_model.curve_part,
        "stability": offline_model.stability_part,
        "fieldLines": offline_model.field_lines_part,
        "commands": state_commands.commands,
    }
    try:
        state = request_of(case).state
        return {name: functions[name](state) for name in parts}
    except BadInput as error:
        return {"error": str(error)}


def worst(ours, theirs, path=""):
    """Pairs (relative difference, place) of two answers; components of a vector are relative to its length."""
    assert type(ours) is type(theirs) or {type(ours), type(theirs)} == {int, float}, path
    if isinstance(theirs, dict):
        assert list(ours) == list(theirs), path
        return max((worst(ours[key], theirs[key], f"{path}.{key}") for key in theirs), default=(0.0, path))
    if isinstance(theirs, list) and theirs and all(isinstance(one, float) for one in theirs):
        size = max(np.linalg.norm(theirs), 1e-12)
        return float(np.linalg.norm(np.subtract(ours, theirs))) / size, path
    if isinstance(theirs, list):
        assert len(ours) == len(theirs), path
        return max((worst(*pair, path) for pair in zip(ours, theirs, strict=True)), default=(0.0, path))
    if isinstance(theirs, float):
        return abs(ours - theirs) / max(abs(theirs), 1e-12), path
    assert ours == theirs, path
    return 0.0, path


def plain(value):
    """Numbers as floats, so that 0 and 0.0 are one."""
    return json.loads(json.dumps(value), parse_int=float)


@pytest.fixture(scope="module")
def answers(page, cases):
    """Answers to all states by JavaScript and by Python."""
    ours = page.run(f"JSON.stringify(theAnswers({json.dumps(cases)}, ['state']))")
    ours = json.loads(ours)
    return [(plain(ours[k]), plain(by_python(case, ["state"]))) for k, case in enumerate(cases)]


def test_javascript_and_python_agree_on_random_states(answers):
    assert len(answers) == DESIGNS * LOADS
    solved = [(ours["state"], theirs["state"]) for ours, theirs in answers if "state" in theirs]
    assert len(solved) > 100
    difference, place = max(worst(*pair) for pair in solved)
    assert difference < AGREEMENT, place


def test_refused_states_agree_in_words(answers):
    refused = [(ours.get("error"), theirs["error"]) for ours, theirs in answers if "error" in theirs]
    assert len(refused) > 40
    assert [ours for ours, _ in refused] == [theirs for _, theirs in refused]
    assert len({re.sub(r"[\d.]+", "#", theirs) for _, theirs in refused}) >= 5


def test_curves_stability_and_field_lines_agree(page, cases, answers):
    parts = ["curve", "stability", "fieldLines"]
    some = [case for case, (_, theirs) in zip(cases, answers, strict=True) if "state" in theirs][::40]
    ours = plain(page.run(f"theAnswers({json.dumps(some)}, {json.dumps(parts)})"))
    theirs = [plain(by_python(case, parts)) for case in some]
    difference, place = worst(ours, theirs)
    assert difference < AGREEMENT, place


@pytest.mark.parametrize(
    ("design", "load"),
    [
        ({}, {"depth": 1.0, "shear": -2.0, "direction": 90, "friction": "stick"}),
        ({"D": 10.5, "L": 12, "magnet_north": "up", "E": 2e-3}, {"depth": 0.3, "friction": "none"}),
    ],
)
def test_commands_are_those_of_the_server(page, design, load):
    case = {"number": 1, "state": {"design": design, "load": load}, "formula_level": "paper"}
    assert page.run(f"theAnswers([{json.dumps(case)}], ['commands'])[0]") == by_python(case, ["commands"])


@pytest.mark.parametrize(
    ("design", "load"),
    [
        ({"L": 3}, {}),
        ({"D": 500}, {}),
        ({"magnet_diameter": 7.9}, {}),
        ({"magnet_height": 0}, {}),
        ({"l0": 0.5}, {}),
        ({"hall_null": 5}, {}),
        ({"hall_average": 1.5}, {}),
        ({"magnet_edge_radius": 3}, {}),
        ({"ogden_alpha1": 0}, {}),
        ({"law": "yeoh"}, {}),
        ({"loss_low": 2000}, {}),
        ({"prony": "0.1"}, {}),
        ({"prony": "0.7:1 0.3:2"}, {}),
        ({"prony": "0.1:0"}, {}),
        ({"prony": "-0.1:1"}, {}),
        ({"prony": "0.1:1  0.2:1.0"}, {}),
        ({"prony": "0:1"}, {}),
        ({"prony": "0.1:1 0:2"}, {}),
        ({}, {"depth": 8}),
        ({}, {"depth": -1}),
        ({}, {"friction": -0.1}),
        ({}, {"plate_tilt": 80}),
        ({}, {"shear": 30, "friction": "stick"}),
    ],
)
def test_an_impossible_state_is_refused_in_the_words_of_the_command_line(page, design, load):
    state = {"design": design, "load": {"depth": 1.0, "friction": "none"} | load}
    case = {"number": 1, "state": state, "formula_level": "paper"}
    theirs = by_python(case, ["state"])
    assert page.run(f"theAnswers([{json.dumps(case)}], ['state'])[0]") == {"error": theirs["error"]}


def test_numbers_are_written_as_python_writes_them(page):
    rng = np.random.default_rng(3)
    values = [*(rng.normal(size=200) * 10.0 ** rng.integers(-9, 12, 200)), 0.3125, 2.5, 1e5, 999999.5, 0.0, 3.0]
    formats = [(value, digits) for value in values for digits in (3, 4, 6)]
    ours = page.run(f"{json.dumps(formats)}.map(([value, digits]) => PythonText.general(value, digits))")
    assert ours == [f"{value:.{digits}g}" for value, digits in formats]


def test_the_page_is_one_small_file(file, sections):
    full = np.zeros((len(offline_sections.DEPTHS), len(offline_sections.SHEARS), *sections.values.shape[2:]))
    more = len(
        json.dumps(
            offline_sections.data(paper(), offline_sections.Sections(**fields_of(sections) | {"values": full}))
        )
    )
    assert file.stat().st_size + more < MOST_BYTES
    text = re.sub(r"<script>.*?</script>|<style>.*?</style>", "", file.read_text("utf-8"), flags=re.S)
    assert re.findall(r'(?:src|href)="([^"]*)"', text) == ["data:,", "#stage"]


def fields_of(sections):
    return {name: getattr(sections, name) for name in ("rest", "triangles", "depths", "shears", "values")}


def test_the_page_asks_no_network_and_writes_no_message(page, file):
    assert [each["request"]["url"] for each in page.of("Network.requestWillBeSent")] == [file.resolve().as_uri()]
    assert page.of("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded") == []


def test_keys_on_a_slider_move_numbers_and_picture(page):
    page.wait("document.querySelector('[data-table=response] .value')?.textContent.length > 1")
    before = page.run(PICTURE)
    page.run("document.querySelector('#groups input[type=range]').focus()")
    force = page.run(FORCE)
    page.key("ArrowRight")
    page.wait(f"({FORCE}) !== {json.dumps(force)}")
    page.wait(f"({PICTURE}) !== {json.dumps(before)}")
    assert page.run("document.querySelector('[data-table=response] .width').textContent").startswith("±")
    assert "surrogate" in page.run("document.querySelector('figcaption').textContent")
    assert page.run("document.querySelector('#decoded-panel').textContent.includes('By the surrogate, status ok')")


PICTURE = "document.querySelector('figure.section canvas').toDataURL()"
FORCE = "document.querySelector('[data-table=response] .value').textContent"


def test_a_refused_design_keeps_the_picture_and_says_why(page):
    before = page.run("location.hash")
    page.run("location.hash = '#preset=paper&law=yeoh'")
    page.wait("document.querySelector('figcaption').textContent.includes('the law neo-hookean only')")
    assert page.run("document.querySelector('figure.section').classList.contains('stale')")
    page.run(f"location.hash = {json.dumps(before)}")
    page.wait("!document.querySelector('figure.section').classList.contains('stale')")


def test_the_page_fits_a_narrow_screen(page):
    page.size(390, 800)
    assert page.run("document.documentElement.scrollWidth") <= 390
    page.size(1280, 900)


def test_design_and_numbers_are_exported_without_a_server(page):
    case = {
        "state": {"design": {"D": 10, "L": 12}, "load": {"depth": 1.0, "friction": "none"}},
        "formula_level": "paper",
    }
    text = page.run(f"Explorer.engine.file('design.toml', {json.dumps(case)}).then((blob) => blob.text())")
    assert Design(**tomllib.loads(text)) == Design(D=10, L=12)
    table = page.run(f"Explorer.engine.file('state.csv', {json.dumps(case)}).then((blob) => blob.text())")
    force = next(line for line in table.splitlines() if line.startswith("force_z,N,"))
    expected = offline_model.state_part(request_of({"number": 1, **case}).state)["response"]["force"][2]
    assert float(force.split(",")[2]) == pytest.approx(expected, rel=AGREEMENT)


def test_a_stored_section_is_shown_as_it_was_solved(page, sections):
    depth = sections.depths[2] * paper().D
    section = page.run(f"""(() => {{
      const one = theModel.checked({{ load: {{ depth: {depth}, friction: "none" }} }});
      const [u, w, t] = theModel.solve(one).plane.value;
      const pictures = StoredSections.load(OfflineData.decoded(MAGTIP_OFFLINE.sections));
      return pictures.section(one.design, {{ load: one.load, pose: {{ u, w, t }} }});
    }})()""")
    assert section["note"] == ""
    moved = sections.rest + sections.values[2, 0, :2].T
    # the surrogate, and not the coarser solve of the picture, places the magnet
    assert np.abs(np.array(section["section"]["points"]) / paper().D - moved).max() < 2e-3
    assert section["section"]["plate"]["z"] == pytest.approx(paper().L - depth)


def test_another_design_says_that_its_picture_is_fitted(page):
    texts = page.run("""(() => {
      const pictures = StoredSections.load(OfflineData.decoded(MAGTIP_OFFLINE.sections));
      const twice = { D: 16, L: 18, magnet_diameter: 8, magnet_height: 4, magnet_edge_radius: 0.2, l0: 14 };
      return [twice, { L: 14, l0: 13 }].map((design) => {
        const one = theModel.checked({ design, load: { depth: 0.8, friction: "none" } });
        const [u, w, t] = theModel.solve(one).plane.value;
        const { section, note } = pictures.section(one.design, { load: one.load, pose: { u, w, t } });
        return [note, Math.max(...section.rest.map(([, z]) => z))];
      });
    })()""")
    assert texts[0] == ["", 18]
    assert "fitted to this design" in texts[1][0]
    assert texts[1][1] == 14


def test_errors_are_those_of_the_shipped_table():
    text = offline_page.about()
    assert "120 unseen beams" in text
    assert offline_page.ERRORS.read_bytes() == (ROOT / "results" / "surrogate" / "summary.csv").read_bytes()
    assert math.isclose(float(re.search(r"press force ([\d.]+) %", text)[1]), 0.6, abs_tol=0.05)


def test_a_design_that_the_surrogate_refuses_has_no_page(run):
    status, _, message = run("explore", "paper", "--set", "law=yeoh", "--export", "sensor.html")
    assert status == 2
    assert "the law neo-hookean only; got yeoh, and a page without a server has no other model" in " ".join(
        message.split()
    )


def test_the_file_of_a_page_ends_in_html(run):
    status, _, message = run("explore", "paper", "--export", "sensor.txt")
    assert status == 2
    assert ".html" in message


def test_the_sensor_in_3d_ends_at_the_plate_and_on_the_base(page):
    case = {"load": {"depth": 1.0, "shear": 0.8, "direction": 60, "friction": "stick"}}
    part = page.run(f"""(() => {{
      const one = theModel.checked({json.dumps(case)}), [u, w, t] = theModel.solve(one).plane.value;
      const pictures = StoredSections.load(OfflineData.decoded(MAGTIP_OFFLINE.sections));
      return pictures.surface(pictures.section(one.design, {{ load: one.load, pose: {{ u, w, t }} }}).section);
    }})()""")
    assert list(part["parts"]) == ["back", "front", "cut", "magnet"]
    skin = np.concatenate([np.array(part["parts"][name]["points"]).reshape(-1, 3) for name in ("back", "front")])
    # the orders of the angle above 1, which a section does not give, leave 0.3 % of D
    assert skin[:, 2].max() == pytest.approx(paper().L - 1.0, abs=0.005 * paper().D)
    assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    # the tip has moved along the direction of the shear
    tip = skin[skin[:, 2] > paper().L - 1.05].mean(axis=0)[:2]
    assert math.degrees(math.atan2(tip[1], tip[0])) == pytest.approx(60, abs=2)
    assert all(max(each["triangles"]) < len(each["value"]) for each in part["parts"].values())
