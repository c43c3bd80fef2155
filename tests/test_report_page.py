"""The page of a report in headless Chromium: what it draws, loads, says by keys and pointer, and prints."""

import io
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from browser import drag, opened, said, wait
from explorer_scripts import RATIO

from fem import equilibrium
from fem.accuracy import QUICK
from geometry.design import paper
from geometry.loads import Load
from studies.output import provenance, vtk_files
from studies.web import folder_contents, report_page, report_sections

RESULTS = Path(__file__).resolve().parent.parent / "results"
HOSTILE = '</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 1">'
CONTRAST = f"""(() => {{{RATIO}
  const names = ['--ink', '--soft', '--link', ...[0, 1, 2, 3, 4, 5, 6].map((k) => '--s' + k)];
  return Object.fromEntries(names.map((name) => [name, ratio(name, '--paper')]));
}})()"""
"""Contrast of texts and of series to the ground."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of many kinds, a solution, and texts that would run if a page did not escape them."""
    root = tmp_path_factory.mktemp("results")
    for name, files in (
        ("demo", "demo/*"),
        ("sweep", "sweep/*"),
        ("trade", "errors/[tT]*"),
        ("verify", "verify/[vV]*"),
    ):
        (root / name).mkdir()
        for file in RESULTS.glob(files):
            if file.suffix in (".csv", ".md"):
                shutil.copy(file, root / name)
    shutil.copy(RESULTS / "cad" / "base.svg", root)
    vtk_files.write_field(root / "demo" / "press.vtu", equilibrium.solve(paper(), Load(depth=1.0), QUICK))
    (root / "<img src=x onerror=alert(1)>.csv").write_text(
        f'name,value\n"{HOSTILE.replace(chr(34), chr(34) * 2)}",1\n'
    )
    (root / "notes.md").write_text(f"# Title {HOSTILE}\n\n{HOSTILE} [link](javascript:window.hacked=1)\n")
    return root


@pytest.fixture(scope="module")
def report(folder, tmp_path_factory):
    """The file of the page."""
    return Path(report_page.report(folder, tmp_path_factory.mktemp("page") / "report.html", solve=False)["file"])


@pytest.fixture(scope="module")
def page(chromium, report):
    return opened(chromium, report)


@pytest.fixture(scope="module")
def data(page):
    return json.loads(page.evaluate("document.getElementById('report-data').textContent"))


def show(page, selector):
    """Scroll to an element, and wait until the page knows: it hides what the pointer showed when it scrolls."""
    page.evaluate(f"document.querySelector({json.dumps(selector)}).scrollIntoView({{block: 'center'}})")
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def colours(page):
    """The pixels of the figure in 3D as RGB, shape (h, w, 3)."""
    from PIL import Image

    show(page, ".stage")
    picture = page.locator(".stage canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


def middle(page, selector):
    """Centre and size of an element in the window, pixels."""
    return page.evaluate(
        f"(() => {{ const r = document.querySelector({json.dumps(selector)}).getBoundingClientRect();"
        "return [r.x + r.width / 2, r.y + r.height / 2, r.width, r.height]; })()"
    )


def test_page_loads_nothing_and_says_nothing_on_the_console(page):
    requests = {request.url.partition(":")[0] for request in page.requests()}
    assert said(page) == []
    assert "file" in requests
    assert requests <= {"file", "data", "blob"}


def table_of(figure):
    """The rows of a figure's table."""
    columns = figure["spec"]["datasets"][figure["spec"]["data"]["name"]]
    plain = {n: [c["texts"][k] for k in c["at"]] if isinstance(c, dict) else c for n, c in columns.items()}
    return [dict(zip(plain, row, strict=True)) for row in zip(*plain.values(), strict=True)]


def test_every_point_and_cell_is_drawn(page, data):
    drawn = page.evaluate(
        "Object.fromEntries([...document.querySelectorAll('[data-figure]')].map((box) => [box.dataset.figure, "
        "[...box.querySelectorAll('.mark-symbol.role-mark path, .mark-rect.role-mark path')]"
        ".filter((node) => node.__data__.tooltip).length]))"
    )
    expected = {}
    for key, figure in data["figures"].items():
        rows = [row for row in table_of(figure) if row.get("drawn", True) and not row.get("failed")]
        expected[key] = sum("shade" not in row or row["shade"] is not None for row in rows)
    assert len(expected) > 10
    assert min(expected.values()) > 0
    assert drawn == expected


def test_sensor_is_drawn_and_turned_by_a_drag_and_by_keys(page):
    assert page.evaluate("document.querySelector('.stage').dataset.renderer") == "webgl"
    before = colours(page)
    assert len(np.unique(before.reshape(-1, 3), axis=0)) > 100
    x, y, *_ = middle(page, ".stage canvas")
    drag(page, (x, y), (x + 120, y + 20))
    after = colours(page)
    assert (np.abs(after - before).sum(axis=2) > 30).mean() > 0.02
    page.evaluate("document.querySelector('.stage canvas').focus()")
    for _ in range(5):
        page.keyboard.press("ArrowLeft")
    assert (np.abs(colours(page) - after).sum(axis=2) > 30).mean() > 0.02


def test_page_without_webgl_says_so(chromium, report):
    page = chromium.new_page(viewport={"width": 500, "height": 700})
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(report.as_uri())
    wait(page, "document.querySelector('.stage')?.dataset.renderer === 'none'")
    assert "needs WebGL" in page.evaluate("document.querySelector('.stage').textContent")
    page.close()


def test_pointer_reads_a_point_off(page, data):
    show(page, "[data-figure] svg.figure")
    x, y, *_ = middle(page, "[data-figure] svg.figure .mark-symbol.role-mark path:nth-of-type(12)")
    page.mouse.move(x, y)
    text = page.evaluate("document.getElementById('tip').textContent")
    assert not page.evaluate("document.getElementById('tip').hidden")
    assert "press force" in text
    assert "depth (mm): 3" in text


def test_keys_read_points_off_in_order(page):
    page.evaluate("document.querySelector('[data-figure] svg.figure').focus()")
    page.keyboard.press("Escape")
    texts = []
    for key in ("ArrowRight", "ArrowRight", "End", "ArrowDown", "Home"):
        page.keyboard.press(key)
        texts.append(page.evaluate("document.getElementById('live').textContent"))
    depths = [text.partition("depth (mm): ")[2].partition(",")[0] for text in texts]
    assert depths == ["0.25", "0.5", "3", "3", "0.25"]
    assert texts[2].startswith("finite elements, rigid magnet")
    assert texts[3].startswith("the paper's formulas")


def test_tab_reaches_everything_in_the_order_of_the_page(page):
    page.evaluate("document.activeElement.blur(); window.scrollTo(0, 0); document.querySelector('.skip').focus()")
    count = page.evaluate("document.querySelectorAll('svg.figure, canvas, button, nav a').length")
    page.evaluate("window.visited = []; document.addEventListener('focusin', (e) => window.visited.push(e.target))")
    for _ in range(min(count, 60)):
        page.keyboard.press("Tab")
    assert page.evaluate("window.visited.length") >= min(count, 60)
    assert page.evaluate(
        "window.visited.every((node, k, all) => !k || "
        "all[k - 1].compareDocumentPosition(node) & Node.DOCUMENT_POSITION_FOLLOWING)"
    )
    assert page.evaluate(
        "window.visited.some((n) => n.matches('svg.figure')) && window.visited.some((n) => n.matches('canvas'))"
    )


def test_csv_and_table_of_a_figure_have_its_numbers(page, data):
    with page.expect_download() as started:
        page.evaluate("document.querySelector('[data-figure] button[data-csv]').click()")
    lines = started.value.path().read_text("utf-8").splitlines()
    count = len(table_of(next(iter(data["figures"].values()))))
    assert lines[0] == "depth (mm),press force (N),series"
    assert len(lines) - 1 == count
    assert lines[1] == '0.25,0.472051,"finite elements, rigid magnet"'
    assert started.value.suggested_filename == "demo-press-force.csv"
    page.evaluate("document.querySelector('[data-figure] details.data').open = true")
    rows = "document.querySelector('[data-figure] details.data').querySelectorAll('tbody tr').length"
    wait(page, f"{rows} === {count}")


def test_texts_of_files_are_never_executed(page):
    assert page.evaluate("window.hacked === undefined")
    assert page.evaluate("document.querySelectorAll('script').length") == len(report_page.SCRIPTS) + 3
    assert page.evaluate("document.querySelectorAll('img[onerror]').length") == 0
    assert "window.hacked" in page.evaluate("document.body.textContent")


@pytest.fixture
def shown_as(page):
    """Show the page in a theme, on a screen of a width, or as it is printed; afterwards as before."""
    yield page
    page.emulate_media(media="null", color_scheme="null")
    page.set_viewport_size({"width": 1200, "height": 900})


def test_contrast_suffices_in_both_themes(shown_as):
    for theme, ground in (("light", "rgb(255, 255, 255)"), ("dark", "rgb(20, 23, 27)")):
        shown_as.emulate_media(color_scheme=theme)
        wait(shown_as, f"document.documentElement.dataset.theme === '{theme}'")
        ratios = shown_as.evaluate(CONTRAST)
        assert min(ratios[name] for name in ("--ink", "--soft", "--link")) >= 4.5
        assert min(ratios.values()) >= 3
        assert shown_as.evaluate("getComputedStyle(document.body).backgroundColor") == ground


def test_button_changes_the_theme(page):
    grounds = set()
    for _ in range(3):
        page.evaluate("document.getElementById('theme').click()")
        grounds.add(page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert grounds == {"rgb(255, 255, 255)", "rgb(20, 23, 27)"}


def test_narrow_screen_does_not_scroll_sideways(shown_as):
    shown_as.set_viewport_size({"width": 390, "height": 800})
    shown_as.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
    wait(shown_as, "document.querySelectorAll('details.data tbody').length > 0")
    assert shown_as.evaluate("document.documentElement.scrollWidth") <= 390
    shown_as.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = false; })")


def test_page_prints_black_on_white_with_all_figures(shown_as, data):
    shown_as.emulate_media(color_scheme="dark")
    pdf = shown_as.pdf(prefer_css_page_size=True)
    assert pdf.startswith(b"%PDF")
    shown_as.emulate_media(media="print")
    assert shown_as.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    shown = (
        "[...document.querySelectorAll('figure svg.figure, figure canvas')].filter((n) => n.getClientRects().length)"
    )
    assert shown_as.evaluate(f"{shown}.length") == len(data["figures"]) + len(data["surfaces"])


def test_size_is_bounded_and_nothing_is_evaluated(report):
    """Vega interprets its expressions: without that it would need the permission to evaluate texts."""
    policy = report.read_text("utf-8").partition('Content-Security-Policy" content="')[2].partition('"')[0]
    assert "script-src" in policy
    assert "unsafe-eval" not in policy
    assert report.stat().st_size < report_page.MOST_BYTES


def test_ticks_of_a_narrow_range_differ(chromium, tmp_path):
    """Four digits of 0.90001, 0.90002 ... all read 0.9."""
    rows = "".join(f"{0.1 * k:.1f},{0.90001 + 4e-6 * k:.6f},ok\n" for k in range(5))
    (tmp_path / "sweep.csv").write_text("depth_mm,fem_force_N,status\n" + rows)
    page = opened(chromium, Path(report_page.report(tmp_path, solve=False)["file"]))
    script = "[...document.querySelectorAll('svg.figure .role-axis-label text')].map((text) => text.textContent)"
    labels = page.evaluate(script)
    high = [label for label in labels if label.startswith("0.9")]
    assert len(high) > 2
    assert len(set(high)) == len(high)


def test_folders_of_one_title_are_told_apart(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "sweep.csv").write_text("depth_mm,fem_force_N,status\n0.5,1,ok\n1,2,ok\n")
    text = Path(report_page.report(tmp_path, solve=False)["file"]).read_text("utf-8")
    assert "Sweep (one)" in text
    assert "Sweep (two)" in text


def test_a_table_that_contradicts_itself_has_no_figure_and_a_bug_of_a_figure_is_one(tmp_path, monkeypatch):
    row = dict.fromkeys((*report_sections.ASSUMPTION, "D_mm", "L_mm"), 1.0) | {"status": "ok", "shear_mm": 0.0}
    contents = folder_contents.Contents(tmp_path, "", pages={"ASSUMPTION.md": "# x"})
    contents.tables["sweep.csv"] = pd.DataFrame([row, row])
    remarks = report_sections.section(contents, solve=False).remarks
    assert remarks == ["sweep.csv has no figure: two rows of the table are one cell of magnet 1 D high, nu 1."]

    def broken(table):
        raise KeyError("a bug")

    monkeypatch.setattr(report_sections.paper_figures, "assumption", broken)
    with pytest.raises(KeyError, match="a bug"):
        report_sections.section(contents, solve=False)


def test_a_record_of_other_fields_names_no_design(tmp_path):
    contents = folder_contents.Contents(tmp_path, "", run=provenance.Run("", "Made", {"D": 8.0, "colour": "red"}))
    assert report_sections.design_of(contents) is None
