"""Texts of the user in files that programs read: a value is a value there, whatever letters it has."""

import ast
import dataclasses
import re
import tomllib

import pytest
from markdown_it import MarkdownIt

from geometry.design import BadInput, paper
from studies.inputs.user_input import design_text, read_design
from studies.output import literals, provenance, text_tables
from studies.output.page_templates import rendered
from studies.web import offline_page, state_exports
from studies.web.explorer_state import state_of

HOSTILE = (
    'x */ static int evil = 42; /* "',
    'x"); import os',
    'a"\nevil = 1\n"',
    "back\\slash\\",
    "'''\"\"\"",
    "<script>alert(1)</script>|`code` *b* _c_ [l](http://a.b) &lt; # h",
    "/*/ ??/ \u2028 🧲 é",
)


@pytest.mark.parametrize("text", [*HOSTILE, "\x00\x1b\x7f\x85\u2029"])
def test_toml_and_python_read_the_value_back(text):
    (line,) = literals.toml({"key": text})
    assert tomllib.loads(line) == {"key": text}
    assert ast.literal_eval(literals.literal(text)) == text


@pytest.mark.parametrize("value", [1.0, 1e300, 1e-7, 3, True, False])
def test_numbers_and_truths_too(value):
    assert tomllib.loads(literals.toml({"key": value})[0]) == {"key": value}


@pytest.mark.parametrize("text", HOSTILE)
def test_a_design_file_and_the_lines_of_the_page_hold_the_name_of_the_silicone(text, tmp_path):
    design = dataclasses.replace(paper(), silicone=text)
    (tmp_path / "design.toml").write_text(design_text(design), "utf-8")
    assert read_design(str(tmp_path / "design.toml")) == design
    tree = ast.parse(state_exports.python(state_of({"design": {"silicone": text}})))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert imported <= {
        "dataclasses",
        "analytic",
        "fem.accuracy",
        "fem.equilibrium",
        "geometry.design",
        "geometry.loads",
    }
    assert not any(isinstance(node, ast.Import) for node in ast.walk(tree))
    assert design.silicone in {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}


@pytest.mark.parametrize("text", HOSTILE)
def test_a_comment_of_c_ends_where_it_should(text):
    comment = f"/* {literals.in_comment(text)} */"
    assert re.sub(r"/\*.*?\*/", "", comment, flags=re.DOTALL) == ""
    assert "\n" not in comment
    assert comment.count("/*") == 1


@pytest.mark.parametrize("text", HOSTILE)
def test_markdown_shows_a_text_in_its_cell_and_a_command_in_its_span(text):
    parser = MarkdownIt("commonmark").enable("table")
    shown = literals.one_line(text)
    (row,) = re.findall(
        r"<td>.*</td>", parser.render(text_tables.markdown([{"a": text, "b": "end"}])).replace("\n", "")
    )
    assert row == f"<td>{_html(shown)}</td><td>end</td>"
    page = parser.render(provenance.made(f"magtip cad --out '{text}'", "on Python 3"))
    (code,) = re.findall("<code>(.*)</code>", page)
    assert code == _html(f"magtip cad --out '{shown}'")


def _html(text):
    for letter, name in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")):
        text = text.replace(letter, name)
    return text


def test_a_page_of_html_escapes_by_itself():
    page = rendered(
        offline_page.PAGE / "fixed_design.html.j2",
        sensor="<script>alert(1)</script>",
        level="quick",
        stops=offline_page.Stops((0.0, 1.0), (0.0, 1.0), (0.0,)),
        presses=1,
        sheared=1,
        of_array=False,
    )
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


@pytest.mark.parametrize("text", ["a\x1b[2J", "a\x00", "\ud800"])
def test_a_name_that_cannot_be_printed_is_refused(text):
    with pytest.raises(BadInput, match="silicone must be text that can be printed"):
        dataclasses.replace(paper(), silicone=text)
