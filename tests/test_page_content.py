import base64
import io

from PIL import Image

from studies.web import page_content
from studies.web.folder_contents import Contents


def contents(tmp_path, page):
    return Contents(tmp_path, "out", pages={"PAGE.md": page})


def test_markup_of_a_page_is_escaped():
    html = str(
        page_content.page_html(
            "<script>x()</script> **bold** [a](javascript:x()) [b](other.md) [c](https://c.org)", {}, set()
        )
    )
    assert "<script" not in html
    assert "<strong>bold</strong>" in html
    assert "javascript" not in html.partition("<a ")[2]
    assert "<span>b</span>" in html
    assert '<a rel="noreferrer" href="https://c.org">c</a>' in html


def test_pictures_are_those_of_the_page():
    used = set()
    html = str(page_content.page_html('![one](a.png) ![two "q"](b.png)', {"a.png": "data:image/png;base64,AA"}, used))
    assert '<img src="data:image/png;base64,AA" alt="one">' in html
    assert "b.png" not in html
    assert used == {"a.png"}


def test_lead_ends_before_sections_and_long_lists(tmp_path):
    lead = str(
        page_content.lead_of(contents(tmp_path, "# T\n\nFirst.\n\n" + "word " * 300 + "\n\n## More\n\nlast\n"))
    )
    assert "First." in lead
    assert "word" not in lead
    assert page_content.lead_of(contents(tmp_path, "# T\n\n## More\n")) == ""


def test_title_is_the_heading_else_the_kind_else_the_name(tmp_path):
    assert page_content.title_of(contents(tmp_path, "# The `title`\n")) == "The title"
    assert page_content.title_of(Contents(tmp_path, "out", tables={"sweep.csv": None})) == "Sweep"
    assert page_content.title_of(Contents(tmp_path, "a/b")) == "a/b"


def pictures_of(tmp_path, *names):
    for name in names:
        Image.new("RGB", (3000, 1000), "white").save(tmp_path / name)
    return Contents(tmp_path, "", pictures=list(names))


def test_large_picture_gets_smaller(tmp_path):
    source = page_content.sources(pictures_of(tmp_path, "a.png"), set(), page_content.Budget(10**6), [])["a.png"]
    head, _, data = source.partition(",")
    assert head == "data:image/png;base64"
    assert Image.open(io.BytesIO(base64.b64decode(data))).size == (page_content.WIDTH, 367)


def test_picture_that_a_figure_replaces_is_left_out(tmp_path):
    assert page_content.sources(pictures_of(tmp_path, "a.png"), {"a.png"}, page_content.Budget(10**6), []) == {}


def test_picture_without_room_is_named(tmp_path):
    remarks = []
    assert page_content.sources(pictures_of(tmp_path, "a.png"), set(), page_content.Budget(10), remarks) == {}
    assert remarks == ["a.png is not shown: the page would become too large."]


def test_file_that_is_no_picture_is_named(tmp_path):
    (tmp_path / "a.png").write_text("no")
    remarks = []
    assert (
        page_content.sources(Contents(tmp_path, "", pictures=["a.png"]), set(), page_content.Budget(99), remarks)
        == {}
    )
    assert remarks[0].startswith("a.png was not read: it is no picture")
