"""The verbs of the command, as `--help` lists them."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import studies
from studies.cli import main
from studies.cli.commands import ACTIONS, _joined, app
from studies.cli.parameters import LEFT_OUT, command
from studies.output import console

ORDER = """
    Design: design cad mesh cache catalogue size
    Simulation: solve analytic compare stability modes response cycle fit demo
    Sensing: field readings calibrate decode stream firmware table layout
    Exploration: explore sweep sensitivity report store
    Validation: validate
    Options: --help --version
"""


def test_help_lists_the_verbs_in_groups_from_a_design_to_its_validation(run):
    text = run("--help")[1]
    listed = re.findall(r"^╭─ (\w+) |^│ ([-\w]+)", text, re.MULTILINE)
    assert [title + ":" if title else verb for title, verb in listed] == ORDER.split()


def test_validate_lists_its_studies(run):
    listed = re.findall(r"^│ ([-\w]+)", run("validate")[1], re.MULTILINE)
    assert listed[:4] == ["verify", "friction", "extremes", "accuracy"]
    assert set(listed) == {name.strip("_") for name in ACTIONS["Validation"]["validate"][2].split()}


def test_a_study_that_was_a_verb_is_found(refusal):
    err = refusal("verify", "--quick")
    assert err == "magtip: verify is a study of validation: type magtip validate verify\n"


# Options, JSON keys and columns of version 0.2 (contract.json) are there: users' scripts depend on them.


CONTRACT = json.loads(Path(__file__).with_name("contract.json").read_text("utf-8"))


def paths(value, before=""):
    """Paths of all keys in JSON, such as `derived.H_mm` and `rows[].name`."""
    if isinstance(value, dict):
        for name, part in value.items():
            yield before + name
            yield from paths(part, f"{before}{name}.")
    elif isinstance(value, list):
        for part in value:
            yield from paths(part, f"{before.removesuffix('.')}[].")


@pytest.mark.parametrize(("verb", "options"), CONTRACT["options"].items())
def test_no_option_is_gone(verb, options, run):
    assert set(options.split()) <= set(re.findall(r"--[a-z][a-z0-9-]*", run(*verb.split(), "--help")[1]))


@pytest.mark.parametrize(("command", "keys"), CONTRACT["keys"].items(), ids=lambda text: text.split()[0])
def test_no_key_is_gone(command, keys, run):
    lines = [json.loads(line) for line in run(*command.split(), "--json")[1].splitlines()]
    assert set(keys.split()) <= {path for line in lines for path in paths(line)}


# No verb writes over what it reads, be it the design, a table, states or a mesh: bad input before any work.


POINTS = "x_mm,y_mm,z_mm\n0,0,20\n"
READINGS = "S1_V,S2_V,S3_V\n3,3,3\n"
STATE = json.dumps({"status": "ok"})
TEST = "stretch,nominal_stress_MPa\n" + "".join(f"{1 + k / 10},{k / 10}\n" for k in range(1, 8))
DESIGN = "E = 0.6\n"

CASES = {
    "field points": ("a.csv", POINTS, ("field", "paper", "--points", "a.csv", "--out", "a.csv")),
    "field design": ("a.csv", DESIGN, ("field", "a.csv", "--points", "p.csv", "--out", "a.csv")),
    "decode readings": ("a.csv", READINGS, ("decode", "paper", "--file", "a.csv", "--out", "a.csv")),
    "decode states": (
        "a.csv",
        STATE,
        ("decode", "paper", "--file", "p.csv", "--responses", "a.csv", "--out", "a.csv"),
    ),
    "table states": ("t.json", STATE, ("table", "paper", "--responses", "t.json", "--out", "t.npy")),
    "table design": ("t.npy", DESIGN, ("table", "t.npy", "--step", 1, "--out", "t.npy")),
    "mesh design": ("a.vtu", DESIGN, ("mesh", "a.vtu", "--out", "a.vtu")),
    "solve mesh": ("a.vtu", "", ("solve", "paper", "--depth", 1, "--mesh", "a.vtu", "--out", "a.vtu")),
    "solve picture": ("a.png", DESIGN, ("solve", "a.png", "--depth", 1, "--picture", "a.png")),
    "fit test": ("fit.csv", TEST, ("fit", "fit.csv", "--out", ".")),
    "sweep design": ("sweep.csv", DESIGN, ("sweep", "sweep.csv", "--axis", "depth=0.5", "--out", ".")),
    "sweep --design": (
        "sweep.csv",
        DESIGN,
        ("sweep", "--design", "sweep.csv", "--axis", "depth=0.5", "--out", "."),
    ),
    "compare design": ("press.csv", DESIGN, ("compare", "press.csv", "--out", ".")),
    "cad design": ("beam.step", DESIGN, ("cad", "beam.step", "--out", ".")),
    "layout states": ("layout.csv", STATE, ("layout", "paper", "--responses", "layout.csv", "--out", ".")),
    "stability design": (
        "stability.csv",
        DESIGN,
        ("stability", "stability.csv", "--slenderness", "2", "--out", "."),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_an_output_onto_an_input_is_bad_input(refusal, tmp_path, case):
    name, text, tokens = CASES[case]
    (tmp_path / name).write_text(text)
    (tmp_path / "p.csv").write_text(POINTS)
    err = refusal(*tokens)
    assert f"the output {name!r} is also the input {name!r}: choose another name" in err or (
        f"{name!r} was not written by magtip and would be overwritten" in err
    )
    assert (tmp_path / name).read_text() == text
    assert {file.name for file in tmp_path.glob("[!.]*")} == {name, "p.csv"}


def test_a_design_of_ones_own_is_not_replaced_by_a_fit(run, refusal, tmp_path):
    (tmp_path / "test.csv").write_text(TEST)
    (tmp_path / "design.toml").write_text(DESIGN)
    status, out, err = run("fit", "test.csv", "--out", ".")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "'design.toml' was not written by magtip and would be overwritten: choose another folder" in err
    assert (tmp_path / "design.toml").read_text() == DESIGN
    (tmp_path / "design.toml").unlink()
    assert run("fit", "test.csv", "--out", ".")[0] == 0
    fitted = (tmp_path / "design.toml").read_text()
    (tmp_path / "design.toml").write_text(fitted + "L = 20.0\n")
    assert "'design.toml' was changed after magtip had written it" in refusal("fit", "test.csv", "--out", ".")
    assert (tmp_path / "design.toml").read_text() == fitted + "L = 20.0\n"


# The commands that results print: they are parsed to what was asked for, and one run again gives the same table.


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


# Standard streams that are full, closed or broken: one sentence, no traceback, and the right exit status.


ROOT = Path(__file__).parent.parent
CODE = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def shell(redirection, *tokens, **more):
    """Run a command line with a shell's redirection."""
    command = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-c", CODE, *tokens]
    return subprocess.run(command, env=ENVIRONMENT, capture_output=True, text=True, check=False, **more)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("option", [(), ("--json",)])
def test_a_full_standard_output_is_named_and_no_folder_blamed(option):
    run = shell(">/dev/full", "design", "paper", *option)
    assert (run.returncode, run.stderr) == (
        2,
        "magtip: cannot write to standard output (No space left on device): redirect it elsewhere\n",
    )


def test_a_closed_standard_output_leads_nowhere(tmp_path):
    run = shell(">&-", "design", "paper")
    assert (run.returncode, run.stderr) == (0, "")
    # nothing that is printed may end in a file that gets the number of the closed stream
    run = shell(">&-", "table", "paper", "--step", "1", "--plane", "--out", "t.npy", cwd=tmp_path)
    assert (run.returncode, (tmp_path / "t.npy").read_bytes()[:6]) == (0, b"\x93NUMPY")


@pytest.mark.parametrize("redirection", ["2>&-", "2>/dev/full"])
def test_what_cannot_be_said_does_not_change_the_status(redirection):
    if "full" in redirection and not os.path.exists("/dev/full"):
        pytest.skip("needs /dev/full")
    run = shell(redirection, "design", "papre")
    assert (run.returncode, run.stdout, run.stderr) == (2, "", "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_standard_error_is_dropped_so_that_the_exit_flushes_it_without_an_error(monkeypatch):
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stderr", full)
        console.say("lost")
        full.write("also lost")
        full.flush()
