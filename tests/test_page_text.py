from studies.web import page_text
from studies.web.folder_contents import Contents


def contents(tmp_path, page):
    return Contents(tmp_path, "out", pages={"PAGE.md": page})


def test_markup_of_a_page_is_escaped():
    html = str(
        page_text.page_html(
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
    html = str(page_text.page_html('![one](a.png) ![two "q"](b.png)', {"a.png": "data:image/png;base64,AA"}, used))
    assert '<img src="data:image/png;base64,AA" alt="one">' in html
    assert "b.png" not in html
    assert used == {"a.png"}


def test_lead_ends_before_sections_and_long_lists(tmp_path):
    lead = str(page_text.lead_of(contents(tmp_path, "# T\n\nFirst.\n\n" + "word " * 300 + "\n\n## More\n\nlast\n")))
    assert "First." in lead
    assert "word" not in lead
    assert page_text.lead_of(contents(tmp_path, "# T\n\n## More\n")) == ""


def test_title_is_the_heading_else_the_kind_else_the_name(tmp_path):
    assert page_text.title_of(contents(tmp_path, "# The `title`\n")) == "The title"
    assert page_text.title_of(Contents(tmp_path, "out", tables={"sweep.csv": None})) == "Sweep"
    assert page_text.title_of(Contents(tmp_path, "a/b")) == "a/b"
