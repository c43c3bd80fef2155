"""The commands that results print: they are parsed to what was asked for, and one run again gives the same table."""

import ast
import re
import shlex
from pathlib import Path

import pytest

import studies
from studies.cli import main
from studies.cli.commands import _joined, app
from studies.cli.parameters import LEFT_OUT, command

LINES = [
    "stability paper --slenderness 1,2 --magnet ignored --accuracy quick --set E=0.6 --set nu=0.45 --out out/s",
    "stability 'my design.toml' --slenderness 3",
    "layout paper --search --range f=5,8 --range l0=9 --count 3 --claim --level tip --clearance 0.2 --ignore-tilt",
    "layout design.toml --responses states.jsonl --mode magnitude --set hall_layout=tmag5273a1",
    "validate verify --quick --out 'a folder/with it'\"'\"'s quote'",
    "validate friction --out out/friction",
    "validate extremes --quick --json",
    "validate accuracy --quick",
    "validate crosscheck --accuracy standard --count 3",
    "validate ladder --count 2",
    "validate range --count 4 --out out/range",
    "validate bench --quick --peers out/p --ccx /opt/ccx",
    "demo --out elsewhere",
    "solve paper --depth 1 --shear -1.5 --steps 2 --friction 0.5 --harmonics 3 --picture p.png",
    "readings paper --shift -1,0,0 --tilt 0,0.1 --seed 3",
    "cad paper --out c --mold shrink=0.01 --mold columns=2 --axis D=7,8 --tolerance 0.001",
    "sweep --axis D=6,8 --axis depth=0.5,1 --magnet ignored",
    "sensitivity paper --depth 1 --vary nu=0.45:0.5 --vary E=0.8:1.2 --methods sobol --tolerance E=5 --count 64",
]


def parsed(line):
    """The verb and its arguments, without those that change only what the screen shows."""
    verb, bound, _ = app.parse_args(_joined(shlex.split(line)), exit_on_error=False, print_error=False)
    bound.apply_defaults()
    return verb, {key: value for key, value in bound.arguments.items() if key not in LEFT_OUT}


@pytest.mark.parametrize("line", LINES)
def test_a_command_is_parsed_to_the_arguments_it_was_made_of(line):
    verb, given = parsed(line)
    written = command(verb, given)
    assert shlex.split(written)[0] == "magtip"
    assert parsed(written.removeprefix("magtip ")) == (verb, given)
    assert not {"--json", "--wide"} & set(shlex.split(written))


def test_defaults_are_left_out():
    verb, given = parsed("stability paper --accuracy standard --magnet rigid")
    assert command(verb, given) == "magtip stability paper"


def printed(page):
    """The command in the last sentence of a page."""
    return re.findall(r"Made with `(magtip [^`]*)`", page.read_text("utf-8"))[-1]


def test_the_command_in_a_page_makes_that_page_again(run, tmp_path, monkeypatch):
    """STABILITY.md, of a design and with fields that are not the paper's."""
    monkeypatch.chdir(tmp_path)
    design = tmp_path / "my design.toml"
    design.write_text("E = 2.0\n", "utf-8")
    flags = ("--slenderness", "1.5", "--magnet", "ignored", "--accuracy", "quick", "--set", "nu=0.45")
    assert run("stability", design.name, *flags, "--out", "s")[0] == 0
    asked = printed(Path("s/STABILITY.md"))
    assert {"my design.toml", "nu=0.45", "ignored", "quick"} <= set(shlex.split(asked))
    table = Path("s/stability.csv").read_bytes()
    Path("s/stability.csv").unlink()
    assert main(shlex.split(asked)[1:]) == 0
    assert Path("s/stability.csv").read_bytes() == table


def test_a_page_of_a_layout_names_its_design_and_its_basis(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run("layout", "paper", "--clearance", "0.2", "--level", "tip", "--set", "c=3", "--out", "o")[0] == 0
    assert printed(Path("o/LAYOUT.md")) == "magtip layout paper --level tip --clearance 0.2 --out o --set c=3"


def sources():
    return sorted(path for path in Path(studies.__file__).parent.rglob("*.py"))


def test_no_command_is_put_together_elsewhere():
    """An f-string that begins a command `magtip VERB ...` and fills in options."""
    for path in sources():
        text = path.read_text("utf-8")
        for node in ast.walk(ast.parse(text)) if "magtip " in text else ():
            if isinstance(node, ast.JoinedStr):
                made = re.match(rf"f['\"]+`?magtip ({'|'.join(app)})\\b.*--", ast.unparse(node))
                assert not made, f"{path.name}, line {node.lineno}"


def test_no_docstring_is_printed():
    """Under python -OO there are none."""
    root = Path(studies.__file__).parent.parent
    for folder in ("geometry", "fem", "analytic", "studies"):
        for path in (root / folder).rglob("*.py"):
            text = path.read_text("utf-8")
            if "__doc__" not in text:
                continue
            names = {getattr(n, "id", getattr(n, "attr", "")) for n in ast.walk(ast.parse(text))}
            assert "__doc__" not in names, path.name
