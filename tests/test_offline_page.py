"""The explorer's page as one file: its answers against solves, and the page in Chromium."""

import base64
import gzip
import json
import math
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from browser import opened, said, wait

from analytic import hall
from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import Design, paper
from geometry.loads import Load
from studies.mechanics import path_solver, store
from studies.output import atomic_files
from studies.web import offline_page

MOST_BYTES = 4e6
"""Largest size of the page of these few stops: nearly all of it are libraries."""
COARSE = replace(QUICK, section_size=0.3, section_patch=0.1)
STOPS = offline_page.Stops([0.0, 0.5, 1.0], [0.0, 0.4], [30.0 * k for k in range(12)])
FILE_AND_ENGINE = """async (request, name) => {
  const engine = OfflineEngine(MAGTIP_OFFLINE), found = {};
  engine.on.answer = (one) => { found[one.part ?? 'error'] = one.data ?? one.error; };
  await engine.fields();
  if (name) return (await engine.file(name, request)).text();
  engine.ask(request);
  await new Promise((done) => setTimeout(done, 50));
  return JSON.stringify(found, (key, value) => ArrayBuffer.isView(value) ? Array.from(value) : value);
}"""


def written(design, folder, stops):
    """The page of a design, with states of a coarse mesh."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(offline_page, "LEVEL", "quick")
        # critical depth and modes by finite elements, which the server's tests hold, take longer than all else
        patch.setattr(offline_page.state_answers, "by_finite_elements", lambda *_: {"rows": [], "message": ""})
        with store.opened(folder / "solved.sqlite") as kept:
            states = offline_page.answers(design, offline_page.magnet_of(design), stops, COARSE, kept)
            text = offline_page.page(design, stops, states, kept)
        atomic_files.write_text(folder / "explorer.html", text)
    return folder / "explorer.html"


def data_of(file):
    """The data in a page."""
    packed = re.search(r'MAGTIP_OFFLINE = "([^"]+)"', file.read_text("utf-8"))[1]
    return json.loads(gzip.decompress(base64.b64decode(packed)))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return written(paper(), tmp_path_factory.mktemp("page"), STOPS)


def test_a_second_export_solves_for_bodies_only_and_says_the_same(file, monkeypatch):
    first = data_of(file)
    monkeypatch.setattr(path_solver, "solved", lambda *_: 1 / 0)
    again = data_of(written(paper(), file.parent, STOPS))
    assert again["curve"] == first["curve"]
    for row, before in zip(again["states"], first["states"], strict=True):
        for one, other in zip(row, before, strict=True):
            assert one.get("directions", one) == other.get("directions", other)


@pytest.fixture(scope="module")
def page(chromium, file):
    return opened(chromium, file)


def asked(page, *load, name=""):
    """The answers of the page's engine to a load, or one of its files."""
    state = {"load": dict(zip(("depth", "shear", "direction"), load, strict=True))}
    request = {"number": 1, "side": "a", "parts": ["state", "sensor3d", "commands", "field_lines"], "state": state}
    text = page.evaluate(f"({FILE_AND_ENGINE})({json.dumps(request)}, {json.dumps(name)})")
    return text if name else json.loads(text)


@pytest.mark.parametrize(("depth", "shear", "direction"), [(0.5, 0.0, 0.0), (1.0, 0.4, 0.0), (1.0, -0.4, 60.0)])
def test_the_page_shows_the_solve_of_the_nearest_stop(page, depth, shear, direction):
    angle = math.radians(direction)
    x, y = shear * math.cos(angle), shear * math.sin(angle)
    solved = solve(paper(), Load(depth, x, y, friction="stick" if shear else "none"), COARSE)
    answers = asked(page, depth + 0.04, shear + 0.03, direction + 4)
    state, response = answers["state"], solved.response
    assert state["load"]["shear"] == pytest.approx([x, y])
    assert state["response"]["force"] == pytest.approx(response.force, rel=1e-6, abs=1e-7)
    assert state["response"]["shift"] == pytest.approx(response.shift, rel=1e-6, abs=1e-7)
    tilts = np.degrees([response.tilt, response.tilt_y])
    assert [state["response"]["tilt"], state["response"]["tilt_y"]] == pytest.approx(tilts, rel=1e-6, abs=1e-7)
    assert state["readings"]["volts"] == pytest.approx(hall.readings(paper(), response).output, rel=1e-7)
    assert state["estimates"]["force"][2] > 0
    assert state["decoded"]["force"][2] == pytest.approx(response.force[2], rel=0.1)
    # the magnet of the section, and of the sensor in 3D, is where its shift puts it
    along = (-1 if x < 0 else 1) * math.hypot(*response.shift[:2]) * (1 if shear else 0)
    centre = np.mean(answers["state"]["section"]["magnet"], axis=0)
    assert centre == pytest.approx([along, paper().H + response.shift[2]], abs=1e-3)
    assert answers["field_lines"]["centre"] == pytest.approx(centre, abs=1e-3)
    sensor = answers["sensor3d"]
    c, s = math.cos(sensor["turn"]), math.sin(sensor["turn"])
    u, v, _ = np.reshape(sensor["parts"]["magnet"]["points"], (-1, 3)).mean(axis=0)
    assert [c * u - s * v, s * u + c * v] == pytest.approx(response.shift[:2], abs=0.03)
    assert list(sensor["parts"]) == ["back", "front", "cut", "magnet"]
    skin = [np.reshape(sensor["parts"][name]["points"], (-1, 3))[:, 1] for name in ("back", "front")]
    assert skin[0].min() >= -1e-3 >= skin[1].min()


def test_a_load_without_a_solved_state_is_refused_in_a_sentence(page):
    assert asked(page, 0.0, 0.4, 0.0)["error"].startswith("this page has no state of this load")


def test_the_page_is_one_small_file_without_addresses(file):
    assert file.stat().st_size < MOST_BYTES
    text = re.sub(r"<script>.*?</script>|<style>.*?</style>", "", file.read_text("utf-8"), flags=re.S)
    assert re.findall(r'(?:src|href)="([^"]*)"', text) == ["data:,", "#stage"]
    assert "2 presses to 1 mm and 2 shears" in " ".join(text.split())


def test_the_page_asks_no_network_and_writes_no_message(page, file):
    assert [request.url for request in page.requests()] == [file.resolve().as_uri()]
    assert said(page) == []


PICTURE = "document.querySelector('figure.section canvas').toDataURL()"
NUMBER = "document.querySelector('[data-table=response] .value').textContent"


def test_only_the_load_moves_and_moves_numbers_and_picture(page):
    wait(page, "Explorer.complete()")
    names = page.evaluate("[...document.querySelectorAll('.control')].map((node) => node.dataset.name)")
    assert names == ["depth", "shear", "direction"]
    before, force = page.evaluate(PICTURE), page.evaluate(NUMBER)
    page.evaluate("document.querySelector('#groups input[type=range]').focus()")
    page.keyboard.press("ArrowLeft")
    wait(page, f"({NUMBER}) !== {json.dumps(force)}")
    wait(page, f"({PICTURE}) !== {json.dumps(before)}")
    assert page.evaluate("Explorer.sides.a.depth") == 0.5
    assert page.evaluate("document.querySelector('[data-table=response] .width').textContent").startswith("±")


def test_a_design_in_the_address_is_left_out_and_a_load_goes_to_its_stop(page):
    page.evaluate("location.hash = '#preset=paper&D=10&depth=0.4'")
    wait(page, "document.querySelector('#notice').textContent.includes('leaves out: D')")
    assert page.evaluate("Explorer.sides.a.depth") == 0.5
    page.evaluate("location.hash = '#preset=paper'")
    wait(page, "document.querySelector('#notice').hidden")


def test_the_page_fits_a_narrow_screen(page):
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.set_viewport_size({"width": 1280, "height": 900})


def test_commands_and_files_are_those_of_the_state(page):
    commands = asked(page, 1.0, -0.4, 90.0)["commands"]
    assert commands["shell"] == "magtip solve paper --depth 1 --shear-y=-0.4 --friction stick --accuracy quick"
    assert 'Load(depth=1, shear_y=-0.4, friction="stick")' in commands["python"]
    assert tomllib.loads(asked(page, 1.0, 0.0, 0.0, name="design.toml")) == {"base": "paper"}
    head, row = (line.split(",") for line in asked(page, 1.0, -0.4, 90.0, name="state.csv").splitlines())
    force = asked(page, 1.0, -0.4, 90.0)["state"]["response"]["force"]
    assert [float(row[head.index(f"force_N_{k}")]) for k in (1, 2, 3)] == pytest.approx(force)
    assert asked(page, 1.0, 0.0, 0.0, name="curve.csv").startswith("depth_mm,force_N,force_half_width_N")


def test_a_sensor_without_a_magnet_and_of_another_law_has_a_page(tmp_path):
    design = Design(magnet_diameter=0.0, magnet_height=0.0, law="yeoh", yeoh_2=0.1)
    assert offline_page.magnet_of(design) == "ignored"
    text = written(design, tmp_path, offline_page.Stops([0.0, 0.2], [0.0, 0.1], [0.0])).read_text("utf-8")
    assert "the paper&#39;s sensor with" in text


def test_the_file_of_a_page_ends_in_html(refusal):
    assert ".html" in refusal("explore", "paper", "--export", "sensor.txt")
