"""The explorer's page as one file: its tables against solves between their nodes, and the page in Chromium."""

import dataclasses
import json
import math
import re
import tomllib

import numpy as np
import pytest
from browser import opened, said, wait

from analytic import hall
from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import Design, paper
from geometry.loads import Load
from studies.output import atomic_files
from studies.web import offline_page, offline_tables, state_answers

MOST_BYTES = 6e6
COARSE = dataclasses.replace(QUICK, section_size=0.3, section_patch=0.1)
SIZE = 4, 2
FORMULA = "finite"


@pytest.fixture(scope="module")
def grid():
    """A coarse grid of the paper's sensor."""
    return offline_tables.solve(paper(), "rigid", COARSE, size=SIZE)


@pytest.fixture(scope="module")
def file(grid, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "explorer.html"
    atomic_files.write_text(path, offline_page.page(grid, "rigid"))
    return path


@pytest.fixture(scope="module")
def page(chromium, file):
    return opened(chromium, file)


def answer(page, depth, shear=0.0, direction=0.0, part="state"):
    """The part of an answer of the page's engine to a load."""
    load = {"depth": depth, "shear": shear, "direction": direction}
    request = {"number": 1, "side": "a", "formula_level": FORMULA, "parts": [part], "state": {"load": load}}
    text = page.evaluate(f"""new Promise((done) => {{
      const engine = OfflineEngine(MAGTIP_OFFLINE);
      engine.onAnswer((one) => done(JSON.stringify(one.error ? one : one.data)));
      engine.ask({json.dumps(request)});
    }})""")
    # Playwright takes a millisecond for a hundred numbers
    return json.loads(text)


def test_a_spline_is_exact_for_a_cubic_and_knows_where_nodes_are_missing():
    nodes = np.linspace(0, 1, 7)
    values = np.stack([nodes**3, 1 - nodes], axis=1)
    at = np.linspace(0, 1, 31)
    assert offline_tables.between(nodes, values, at, 3) == pytest.approx(np.stack([at**3, 1 - at], axis=1), abs=1e-12)
    values[3] = np.nan
    known = np.isfinite(offline_tables.between(nodes, values, at, 3)[:, 0])
    assert known.tolist() == [not 1 / 3 + 1e-9 < place < 2 / 3 - 1e-9 for place in at.tolist()]


def test_the_page_shows_solved_states_at_the_nodes(page, grid):
    root, shear, state = next(one for one in grid.states if one[1] and one[0] > 0.3)
    depth = root**2 * grid.design.D
    shown = answer(page, depth, shear)
    assert shown["response"]["force"] == pytest.approx(state.response.force, rel=1e-5, abs=1e-6)
    assert shown["response"]["shift"] == pytest.approx(state.response.shift, rel=1e-5, abs=1e-6)
    volts = hall.readings(grid.design, state.response).output
    assert shown["readings"]["volts"] == pytest.approx(volts, abs=1e-5)


@pytest.mark.parametrize(("depth", "shear", "direction"), [(0.7, 0.0, 0.0), (1.3, -1.1, 130.0)])
def test_half_widths_hold_what_is_solved_between_the_nodes(page, depth, shear, direction):
    angle = math.radians(direction)
    x, y = shear * math.cos(angle), shear * math.sin(angle)
    state = solve(paper(), Load(depth, x, y, friction="stick" if shear else "none"))
    shown = answer(page, depth, shear, direction)
    for name, exact in (("force", state.response.force), ("shift", state.response.shift)):
        off, width = np.abs(np.subtract(shown["response"][name], exact)), np.array(shown["estimates"][name])
        assert (off <= width + 1e-9).all(), name
        assert width.max() < 0.1 * np.linalg.norm(exact)
    volts = hall.readings(paper(), state.response).output
    off = np.abs(np.subtract(shown["readings"]["volts"], volts))
    assert (off <= shown["readings"]["half_width"]).all()
    decoder = state_answers.build_decoder(paper())
    exact = state_answers.decoded(decoder, state.response, {"shift": None})
    assert shown["decoded"]["status"] == exact["status"] == "ok"
    off = np.abs(np.subtract(shown["decoded"]["force"], exact["force"]))
    assert (off <= shown["decoded"]["half_width"]).all()


def test_an_interval_of_the_depth_with_a_failed_check_has_unknown_errors(grid):
    place = grid.checks[-1][:2]
    checked = dataclasses.replace(grid, checks=grid.checks[:-1], failed_checks=[place])
    table, errors = offline_tables.response(checked)
    assert np.isnan(errors[-1]).all()
    assert np.isfinite(errors[:-1]).all()
    inside = (table.axes[0] > grid.roots[-2] + 1e-9) & (table.axes[0] < grid.roots[-1] - 1e-9)
    assert np.isnan(table.values[inside][..., offline_tables.WIDTHS]).all()
    assert np.isfinite(table.values[inside][:, 0, offline_tables.RESPONSE]).all()


def test_a_press_and_a_shear_beyond_the_solved_states_are_refused_in_a_sentence(page):
    for load in ((3.5, 0.0), (1.0, 4.0), (0.01, 1.0)):
        said = answer(page, *load)
        assert said["error"].startswith("This page has states to a depth of 3 mm, and shears to 3 mm")


def test_section_and_skin_end_at_the_plate_and_on_the_base(page):
    section = answer(page, 1.0, 0.8, 60.0)["section"]
    top = max(point["1"] if isinstance(point, dict) else point[1] for point in section["points"])
    assert top == pytest.approx(paper().L - 1.0, abs=0.02 * paper().D)
    assert section["plate"]["z"] == pytest.approx(paper().L - 1.0)
    parts = answer(page, 1.0, 0.8, 60.0, "sensor3d")["parts"]
    assert list(parts) == ["back", "front", "cut", "magnet"]
    skin = np.concatenate([np.array(parts[name]["points"]).reshape(-1, 3) for name in ("back", "front")])
    assert skin[:, 2].max() == pytest.approx(paper().L - 1.0, abs=0.02 * paper().D)
    assert skin[:, 2].min() == pytest.approx(0.0, abs=1e-3)
    tip = skin[skin[:, 2] > paper().L - 1.1].mean(axis=0)[:2]
    assert math.degrees(math.atan2(tip[1], tip[0])) == pytest.approx(60, abs=3)


def test_the_page_is_one_small_file_without_addresses(file):
    assert file.stat().st_size < MOST_BYTES
    text = re.sub(r"<script>.*?</script>|<style>.*?</style>", "", file.read_text("utf-8"), flags=re.S)
    assert re.findall(r'(?:src|href)="([^"]*)"', text) == ["data:,", "#stage"]
    for words in ("This file is fixed to one design, the paper's sensor", "accuracy standard", "off by at most"):
        assert words in text.replace("&#x27;", "'")


def test_the_page_asks_no_network_and_writes_no_message(page, file):
    assert [request.url for request in page.requests()] == [file.resolve().as_uri()]
    assert said(page) == []


PICTURE = "document.querySelector('figure.section canvas').toDataURL()"
NUMBER = "document.querySelector('[data-table=response] .value').textContent"


def test_only_the_load_moves_and_moves_numbers_and_picture(page):
    wait(page, "Explorer.complete()")
    names = page.evaluate("[...document.querySelectorAll('.control')].map((node) => node.dataset.name)")
    assert names == list(offline_page.MOVED)
    before, force = page.evaluate(PICTURE), page.evaluate(NUMBER)
    page.evaluate("document.querySelector('#groups input[type=range]').focus()")
    page.keyboard.press("ArrowRight")
    wait(page, f"({NUMBER}) !== {json.dumps(force)}")
    wait(page, f"({PICTURE}) !== {json.dumps(before)}")
    assert page.evaluate("document.querySelector('[data-table=response] .width').textContent").startswith("±")


def test_a_design_in_the_address_is_named_and_left_out(page):
    page.evaluate("location.hash = '#preset=paper&D=10&depth=0.5'")
    wait(page, "document.querySelector('#notice').textContent.includes('leaves out: D')")
    page.evaluate("location.hash = '#preset=paper'")
    wait(page, "document.querySelector('#notice').hidden")


def test_the_page_fits_a_narrow_screen(page):
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.set_viewport_size({"width": 1280, "height": 900})


def test_commands_and_files_are_those_of_the_state(page):
    commands = answer(page, 1.25, -0.5, 90.0, "commands")
    assert commands["shell"] == "magtip solve paper --depth 1.25 --shear=0 --shear-y=-0.5 --friction stick"
    compile(commands["python"], "lines", "exec")
    assert 'Load(depth=1.25, shear_x=0, shear_y=-0.5, friction="stick")' in commands["python"]
    request = json.dumps({"state": {"load": {"depth": 1.0, "shear": 0, "direction": 0}}, "formula_level": FORMULA})
    text, table, curve = (
        page.evaluate(f"Explorer.engine.file('{name}', {request}).then((blob) => blob.text())")
        for name in ("design.toml", "state.csv", "curve.csv")
    )
    assert tomllib.loads(text) == {"base": "paper"}
    force = next(line for line in table.splitlines() if line.startswith("force_z,N,"))
    assert float(force.split(",")[2]) == pytest.approx(answer(page, 1.0)["response"]["force"][2])
    assert curve.startswith("depth_mm,force_N,force_half_width_N")


def test_a_sensor_without_a_magnet_and_of_another_law_has_a_page(monkeypatch):
    monkeypatch.setattr(offline_tables, "DEEPEST", 0.1)
    monkeypatch.setattr(offline_tables, "FARTHEST", 0.05)
    monkeypatch.setattr(offline_page, "LEVEL", "quick")
    design = Design(magnet_diameter=0.0, magnet_height=0.0, law="yeoh", yeoh_2=0.1)
    assert offline_page.magnet_of(design) == "ignored"
    grid = offline_tables.solve(design, "ignored", COARSE, size=SIZE)
    assert "the paper&#x27;s sensor with" in offline_page.page(grid, "ignored")


def test_the_file_of_a_page_ends_in_html(refusal):
    assert ".html" in refusal("explore", "paper", "--export", "sensor.txt")
