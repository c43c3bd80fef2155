"""The explorer's page in headless Chromium, with its real server: controls, pictures, exports, losses, refusals."""

import base64
import io
import json
from itertools import pairwise
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import drag, opened, said, wait
from explorer_scripts import BOXES, CLIPPED, CONTRAST, COUNT, DRAG, LATE, PLATE, RESPONSE, TYPE
from explorer_session import (
    ask,
    click,
    drawn,
    go,
    heap,
    memory,
    move,
    other_value,
    protocol,
    random_moves,
    rest,
    server,
)

from geometry.design import BadInput, Design, preset
from studies.inputs import user_input

QUICK = "#preset=paper&level=quick"
SECTION, SENSOR = "figure.section canvas", "figure.sensor canvas"


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    """A server of an array, whose page has all that a single sensor's has."""
    file = tmp_path_factory.mktemp("served") / "array.toml"
    file.write_text('base = "paper"\n[array]\nrows = 2\ncolumns = 2\npitch = 16.0\npolarity = "rows"\n')
    with server(design=file) as (process, address):
        yield process, address


@pytest.fixture(scope="module")
def page(chromium, served):
    page = opened(chromium, served[1] + QUICK, 1400, 900)
    rest(page)
    return page


@pytest.fixture
def start(page):
    """Show a state and wait for its picture."""

    def show(state=""):
        go(page, QUICK + state)
        return page

    return show


@pytest.fixture
def download(page, tmp_path):
    """Click an export and return the path of its file."""

    def get(name):
        with page.expect_download(timeout=30_000) as started:
            page.evaluate(f"document.querySelector('[data-export=\"{name}\"]').click()")
        path = tmp_path / started.value.suggested_filename
        started.value.save_as(path)
        return path

    return get


def text(page, selector):
    """The text of an element."""
    return page.evaluate(f"document.querySelector({json.dumps(selector)}).innerText")


def colours(page, selector):
    """The different colours of a canvas, shape (n, 4)."""
    from PIL import Image

    data = page.evaluate(f"document.querySelector({json.dumps(selector)}).toDataURL('image/png')").partition(",")[2]
    image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA")
    return np.unique(np.asarray(image).reshape(-1, 4), axis=0)


def request(page, side="a"):
    """The message that the page sends for its present state."""
    return page.evaluate(f"Explorer.message({json.dumps(side)})")


def test_sections_sensors_and_figures_are_drawn_and_read_by_keys(start):
    page = start()
    wait(page, "Explorer.complete()")
    for selector in (SECTION, SENSOR):
        assert len(colours(page, selector)) > 20
    # lines and points of three models, bars with their rests
    for name in ("force", "shift", "readings"):
        marks = f"document.querySelectorAll('[data-chart={name}] .role-mark :is(path, line)').length"
        wait(page, f"{marks} > 6")
    page.evaluate("document.querySelector('[data-chart=force] svg').focus()")
    for key, words in (
        ("ArrowRight", "finite elements"),
        ("ArrowRight", "normal force (N)"),
        ("ArrowDown", "paper's"),
    ):
        page.keyboard.press(key)
        assert words in page.evaluate("document.getElementById('live').textContent")


def test_controls_and_views_change_picture_and_numbers_and_no_box(start):
    page = start("&depth=0.5")
    wait(page, "Explorer.complete()")
    boxes, pictures, numbers = page.evaluate(BOXES), {drawn(page, SECTION)}, {text(page, "[data-table=response]")}
    for name, value in (
        ("D", 10),
        ("magnet", "ignored"),
        ("magnet", "rigid"),
        ("D", 8),
        ("depth", 2),
        ("shear", -0.6),
    ):
        move(page, name, value)
        rest(page)
        pictures.add(drawn(page, SECTION))
        numbers.add(text(page, "[data-table=response]"))
    wait(page, "Explorer.complete()")
    assert (len(pictures), page.evaluate(BOXES)) == (5, boxes)
    assert len(numbers) >= 5
    for field in ("pressure", "stretch"):
        ask(page, TYPE, "view-field", field, "change")
        rest(page)
        pictures.add(drawn(page, SECTION))
    for button in ("view-lines", "view-mesh"):
        click(page, button)
        wait(page, "Explorer.resting() && (Explorer.view.lines === 'no' || Explorer.answers.a.field_lines)")
        pictures.add(drawn(page, SECTION))
    assert len(pictures) == 9


TWO = "&frequency=300&speed=2&b.preset=paper&b.D=10&b.frequency=300&view.edit=b"


@pytest.mark.parametrize("state", ["", TWO])
def test_panels_are_filled_and_fit_and_do_not_overlap(start, state):
    page = start(state)
    wait(page, "Explorer.complete()")
    try:
        for width in (390, 900, 1400):
            page.set_viewport_size({"width": width, "height": 900})
            wait(page, "Explorer.complete()")
            boxes = page.evaluate(BOXES)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert all(0 <= left < right <= width for left, _, right, _ in boxes)
            for k, (a, b, c, d) in enumerate(boxes):
                assert all(c <= e or g <= a or d <= f or h <= b for e, f, g, h in boxes[k + 1 :])
            assert page.evaluate(CLIPPED) == []
    finally:
        page.set_viewport_size({"width": 1400, "height": 900})
    vibration, loop = (text(page, f"[data-table={name}]") for name in ("vibration", "loop"))
    decoded = "document.querySelector('[data-table=decoded]').innerText"
    wait(page, rf"/normal force is 0\.\d+ N off the finite/.test({decoded})")
    if not state:
        assert "A speed above 0 mm/s" in loop
        return
    assert "force along z, over static" in vibration
    assert "contact is frozen" in vibration
    assert "gap of a linear spring" in loop
    click(page, "compare")
    wait(page, "document.querySelector('[data-command]').textContent.includes('cycle')")
    shell, python = page.evaluate("[...document.querySelectorAll('[data-command]')].map((node) => node.textContent)")
    assert [line.split()[1] for line in shell.splitlines()] == ["solve", "response", "cycle"]
    compile(python, "lines", "exec")


def test_address_gives_the_same_page_and_tabs_are_independent(chromium, served, start):
    page = start("&D=10&L=12&magnet=ignored&depth=0.5&direction=40&friction=none&view.field=stretch")
    other = opened(chromium, served[1] + page.evaluate("location.hash"), 1400, 900)
    try:
        rest(other)
        assert request(other) == request(page)
        assert other.evaluate("Explorer.address()") == page.evaluate("Explorer.address()")
        assert other.evaluate(RESPONSE) == pytest.approx(page.evaluate(RESPONSE), rel=1e-4)
        move(other, "depth", 0.3)
        rest(other)
        assert page.evaluate("Explorer.answers.a.state.data.load.depth") == 0.5
        assert other.evaluate("Explorer.answers.a.state.data.load.depth") == 0.3
        go(other, f"{QUICK}&depht=2&view.field=torque")
        assert "leaves out: depht, view.field." in text(other, "#notice")
    finally:
        other.close()


def test_exported_design_and_picture_open_again(start, download):
    from PIL import Image

    page = start("&D=10&L=12&E=0.5")
    assert user_input.read_design(str(download("design.toml"))) == Design(D=10, L=12, E=0.5)
    with Image.open(download("picture.png")) as image:
        shown = np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0)
        assert image.width > page.evaluate(f"document.querySelector('{SECTION}').width")
    assert len(shown) > 200


def test_texts_have_enough_contrast(page):
    for theme in ("light", "dark"):
        page.evaluate(f"document.documentElement.dataset.theme = '{theme}'")
        ratios = page.evaluate(CONTRAST)
        page.evaluate("delete document.documentElement.dataset.theme")
        assert min(ratios) >= 4.5


def test_every_control_changes_the_request(start):
    page = start("&shear=0.5")
    # a part changes the controls of its values, see below
    for field in page.evaluate("Explorer.fields().filter((field) => field.scope !== 'part')"):
        before = request(page)
        move(page, field["name"], other_value(field))
        assert request(page) != before, field["name"]


def test_parts_of_the_catalogue_are_choices(start):
    page = start()
    for name, part, sets in (
        ("magnet_part", "6x3 N42", {"magnet_diameter": 6, "magnet_height": 3, "remanence": 1.3}),
        ("silicone_part", "Ecoflex 00-30", {"silicone": "Ecoflex 00-30"}),
        ("hall_part", "TMAG5273A1", {"hall_layout": "tmag5273a1"}),
    ):
        move(page, name, part)
        assert sets.items() <= request(page)["state"]["design"].items()
    move(page, "remanence", 1.2)
    wait(page, "document.getElementById('field-magnet_part').value === ''")
    move(page, "grade", "N42")
    wait(page, "document.getElementById('field-magnet_part').value === '6x3 N42'")
    assert page.evaluate("document.getElementById('field-hall_part').value") == "TMAG5273A1"
    # a preset has all fields of its design, from the list and in an address
    move(page, "preset", "fingertip")
    assert request(page)["state"]["design"]["D"] == preset("fingertip").D
    go(page, "#preset=gripper_pad&level=quick&L=40")
    design = request(page)["state"]["design"]
    assert (design["silicone"], design["L"]) == (preset("gripper_pad").silicone, 40)


def test_impossible_design_greys_the_picture_and_says_what_the_command_line_says(start):
    page = start("&depth=0.5")
    before = drawn(page, SECTION)
    ask(page, TYPE, "field-L", "3", "input")
    stale = "document.querySelector('figure.section').classList.contains('stale')"
    wait(page, f"Explorer.refusals.a && {stale}")
    with pytest.raises(BadInput) as error:
        Design(L=3.0)
    assert text(page, "#field-L-refusal") == str(error.value)
    assert page.evaluate("document.getElementById('field-L').getAttribute('aria-invalid')") == "true"
    assert page.evaluate("Explorer.answers.a.state.data.load.depth") == 0.5
    ask(page, TYPE, "field-L", "9", "change")
    wait(page, f"!{stale}")
    rest(page)
    assert drawn(page, SECTION) == before


def test_late_and_coarser_answers_are_dropped(start):
    assert start("&depth=0.7").evaluate(LATE) == [True, True, -1]


def test_newest_state_is_drawn_after_a_drag(start):
    page = start("&depth=0.5")
    page.evaluate(COUNT)
    times = ask(page, DRAG, "field-depth-slider", 0.5, 1.5, 30)
    rest(page)
    asked = page.evaluate("window.asked")
    assert all(a < b for a, b in pairwise(asked))
    assert len(asked) <= 32
    assert page.evaluate("Explorer.answers.a.state.data.load.depth") == pytest.approx(1.5)
    assert all(one["total"] > 0 for one in times)


def test_plate_follows_pointer_and_keys(start):
    page = start()
    wait(page, "Explorer.complete()")
    page.evaluate("document.querySelector('.plate').scrollIntoView({ block: 'center' })")
    x, y = page.evaluate(PLATE)
    drag(page, (x, y), (x + 30, y + 30))
    rest(page)
    load = request(page)["state"]["load"]
    assert 1.2 < load["depth"] < 3
    assert 0.2 < load["shear"] < 2
    page.evaluate("document.querySelector('.plate').focus()")
    for key in ("Home", "ArrowDown", "ArrowDown", "ArrowRight"):
        page.keyboard.press(key)
    rest(page)
    load = request(page)["state"]["load"]
    assert (load["depth"], load["shear"], load["friction"]) == (0.1, 0.05, "stick")
    assert "depth 0.1 mm" in page.evaluate("document.querySelector('.plate').getAttribute('aria-valuetext')")


def test_each_beam_of_an_array_keeps_its_load_and_is_chosen_by_pointer_and_keys(start):
    page = start("&depth=0.8")
    page.click("[data-beam='2']")
    wait(page, "Explorer.sides.a.beam === '2'")
    move(page, "depth", 0.5)
    move(page, "shear", -0.3)
    assert request(page)["state"]["array"] | {"load": request(page)["state"]["load"]["depth"]} == {
        "beam": "2", "beam_loads": "1:0.8,0,0", "polarity": "rows", "pitch": 16, "load": 0.5
    }  # fmt: skip
    page.evaluate("document.querySelector('[data-beam=\"2\"]').focus()")
    for key, beam in (("ArrowUp", "4"), ("ArrowLeft", "3"), ("ArrowLeft", "3"), ("ArrowDown", "1")):
        page.keyboard.press(key)
        wait(page, f"Explorer.sides.a.beam === '{beam}' && document.activeElement.dataset.beam === '{beam}'")
    sent = request(page)["state"]
    assert (sent["load"]["depth"], sent["array"]["beam_loads"]) == (0.8, "2:0.5,-0.3,0")
    rest(page)
    wait(page, "!Explorer.requests().behind('a', 'array')")
    forces = page.evaluate("Explorer.answers.a.array.data.picture.forces")
    (_, _, pressed), (aside, _, _) = forces["set"][:2]
    assert (pressed > 2, aside < 0, forces["set"][2:]) == (True, True, [[0, 0, 0]] * 2)
    assert np.array(forces["jointly"]) == pytest.approx(np.array(forces["set"]), abs=1e-9)
    wait(page, f"document.querySelector('[data-table=array_forces]').textContent.includes('{pressed:.4g}')")
    spoken = page.evaluate("document.querySelector('[data-beam=\"1\"]').getAttribute('aria-label')")
    assert spoken.startswith(f"Beam 1, magnet as designed: as set {pressed:.2f} newtons normal")
    click(page, "undo")
    wait(page, "Explorer.sides.a.beam === '3'")
    ask(page, TYPE, "field-beam_loads", "2:much", "change")
    wait(page, "document.getElementById('field-beam_loads-refusal').textContent.includes('load of beam 2 must')")


def test_undo_redo_and_back_lead_through_the_states(start):
    page = start("&depth=0.6")
    for depth in (0.8, 1.1):
        move(page, "depth", depth)
        page.evaluate("Explorer.commit()")
    for step, depth in (
        ("document.getElementById('undo').click()", 0.8),
        ("history.back()", 0.6),
        ("history.forward()", 0.8),
        ("document.getElementById('redo').click()", 1.1),
    ):
        page.evaluate(step)
        wait(page, f"Explorer.sides.a.depth === {depth}")
    for key, depth in (("z", 0.8), ("y", 1.1)):
        page.keyboard.press(f"Control+{key}")
        wait(page, f"Explorer.sides.a.depth === {depth}")
    assert page.evaluate("document.getElementById('redo').disabled")


def test_two_designs_side_by_side(start):
    page = start("&depth=1")
    click(page, "compare")
    move(page, "D", 10)
    rest(page)
    assert [request(page, side)["state"]["design"] for side in "ab"] == [{}, {"D": 10}]
    a, b = (page.evaluate(f"Explorer.answers.{side}.state.data.response.force[2]") for side in "ab")
    difference = text(page, "[data-table=response] tbody tr td:last-child").replace("\N{MINUS SIGN}", "-")
    assert float(difference) == pytest.approx(b - a, rel=1e-3)
    assert drawn(page, "figure.section[data-side=b] canvas") != drawn(page, SECTION)
    assert "b.D=10" in page.evaluate("Explorer.address()")
    click(page, "compare")
    wait(page, "document.querySelector('figure.section[data-side=b]').hidden")


def test_all_controls_have_names_and_keys_reach_them(page):
    def focusable(node):
        return any(one["name"] == "focusable" and one["value"]["value"] for one in node.get("properties", []))

    nodes = [node for node in protocol(page).send("Accessibility.getFullAXTree")["nodes"] if focusable(node)]
    roles = {node["role"]["value"] for node in nodes}
    assert {"button", "slider", "textbox", "combobox", "checkbox"} <= roles
    unnamed = [node for node in nodes if node["role"]["value"] != "RootWebArea" and not node["name"]["value"]]
    assert unnamed == []


MOST_MB = 2000
"""Memory of the server with both workers that a thousand moves do not exceed, MB."""


def test_random_moves_leave_page_and_memory_as_they_were(served, start):
    page = start()
    random_moves(page, 6)
    go(page, QUICK)
    before = heap(page)
    random_moves(page, 6, seed=1)
    go(page, QUICK)
    assert heap(page) < 1.25 * before + 2e6
    # the workers' caches fill within some hundred moves; `explorer_session` measures a thousand
    assert memory(served[0]) < MOST_MB


def test_page_says_nothing_on_the_console_and_asks_no_other_server(page, served):
    assert said(page) == []
    hosts = {urlsplit(request.url).netloc for request in page.requests()}
    assert hosts <= {urlsplit(served[1]).netloc, ""}


def test_a_page_shows_margins_of_requirements_and_says_when_its_server_is_killed(chromium, tmp_path):
    file = tmp_path / "requirements.toml"
    file.write_text('force_z = "2 N"\nforce_x = "0.4 N"\nouter_size = "20 mm"\nhall_parts = ["TMAG5273A1"]\n')
    # a server of its own, for other tests need theirs
    with server(design=file) as (process, address):
        page = opened(chromium, f"{address}&level=quick", 1400, 900)
        margins_are_shown(page)
        rest(page)
        before = drawn(page, SECTION)
        process.kill()
        wait(page, "document.body.dataset.server === 'gone' && !document.getElementById('notice').hidden")
    assert "start it again" in text(page, "#notice")
    assert drawn(page, SECTION) == before
    with server(urlsplit(address).port):
        wait(page, "document.body.dataset.server === 'token'")
        assert "another token" in text(page, "#notice")


def margins_are_shown(page):
    """The page of a file of requirements opens at the required load, and says what a silicone leaves of them."""
    table = "document.querySelector('[data-table=margins]').innerText"
    note = "document.querySelector('[data-table=margins] .notes').innerText"
    wait(page, f"Explorer.answers.a.state && {note}.includes('All requirements are met')")
    force = page.evaluate("Explorer.answers.a.state.data.response.force")
    assert (force[2], force[0]) == pytest.approx((2.0, 0.4), rel=0.03)
    parts = page.evaluate("[...document.getElementById('field-hall_part').options].map((one) => one.text)")
    assert parts == ["own values", "TMAG5273A1"]
    move(page, "silicone_part", "Ecoflex 00-30")
    wait(page, f"{note}.includes('missed') && {table}.includes('missed by')")
    assert said(page) == []
