"""The command line: verbs and contract, exit statuses, streams, interrupts, and one sentence for bad input."""

import errno
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest
from test_layers import HEAVY

from studies.cli import commands, exploration_commands
from studies.cli.commands import _joined, app
from studies.cli.parameters import LEFT_OUT, command
from studies.output import atomic_files
from studies.output.result import BROKEN_PIPE, INTERRUPTED
from studies.simulation import load_cases

ROOT = Path(__file__).resolve().parent.parent
QUICK = ("--magnet", "ignored", "--accuracy", "quick")


BAD = [
    ("solve", "solve needs DESIGN: add it behind the verb. It is: name of a preset (paper, fingertip"),
    ("solve paper", "no load is given: add --depth D in mm, --force F in N, or --grip HEIGHT with --shear X"),
    ("solve paper --dpeth 1", "did you mean --depth?"),
    ("solve paper --depth nan", "depth must be a finite number of mm, 0 or more; got nan"),
    ("solve paper --depth", "solve: --depth needs a value: add it behind the option"),
    ("stream paper --axes -x,-y,z", "--axes needs a value: one that begins with a minus is written --axes=-x,-y,z"),
    ("solve paper --depth 1 --depth 2", "--depth specified multiple times"),
    ("solve paper --depth 7.5", "depth must be less than 7 mm, the silicone on the axis"),
    ("solve paper --depth 1 --magnet soft", 'Choose from: "rigid", "ignored"'),
    ("solve paper --depth 1 --depths 1,2", "--depth and --depths exclude each other"),
    ("solve paper --depths 1,,2", "each value of --depths must be a finite number; got ''"),
    ("solve paper --depths 1,2 --steps 2", "--depths is for presses only and cannot be combined with --steps"),
    ("solve paper --depth 1 --steps 1e9", "--steps must be a whole number; got 1e9"),
    ("solve paper --depth 1 --steps 0", "--steps must be a whole number between 1 and 1000; got 0"),
    ("solve paper --depth 1 --shear 100", "shear must not exceed 2 L = 18 mm; got 100 mm"),
    ("solve paper --depth 1 --friction glue", "friction must be none, stick or a coefficient of 0 or more"),
    ("solve paper --grip 2", "--grip needs a shear"),
    ("solve paper --grip 2 --shear 1 --depth 1", "a grip has no plate, so depth must be 0; got 1 mm"),
    ("solve paper --grip 2 --shear 1 --friction stick", "--friction has no meaning with --grip"),
    (
        "solve paper --depth 1 --harmonics 3",
        "--harmonics is for model harmonic, but this load uses model axisymmetric",
    ),
    ("solve paper --depth 1 --plate-tilt 50", "plate tilt must be within +-40.1 degrees; got 50"),
    ("solve paper --depth 1 --plate-tilt 5 --model axisymmetric", "model axisymmetric cannot carry a tilted plate"),
    ("solve paper --depth 1 --out field.txt", "the file 'field.txt' must end in .vtu"),
    ("solve paper --depth 1 --out /proc/nowhere/field.vtu", "cannot write to the folder '/proc/nowhere'"),
    ("solve paper --depth 1 --picture field.jpg", "the file 'field.jpg' must end in .png"),
    ("analytic paper", "analytic needs --depth: add --depth and its value"),
    ("analytic paper --depth 5", "depth must not exceed the tip radius D/2 = 4 mm"),
    ("cad paper --out /proc/parts", "cannot write to the folder '/proc/parts'"),
    ("cad paper --ouut parts", "there is no option --ouut: did you mean --out?"),
    ("array paper --pitch 16mm", "--pitch takes a number alone, in the unit that its help names; got '16mm'"),
    ("mesh paper --out mesh.vtu --size 0.01", "size must lie between D/50 = 0.16 and D = 8 mm; got 0.01 mm"),
    ("stability paper --slenderness 1e9", "--slenderness must be at most 500 with D = 8 mm"),
    ("stability paper --slenderness 0", "--slenderness must exceed 0.5"),
    ("stability paper --depth 7", "depth must be less than 7 mm"),
    ("modes paper --count 0", "--count must be between 1 and 40; got 0"),
    (
        "compare paper --depth 1",
        "there is no option --depth: choose one of --out, --accuracy, --tolerance, --set",
    ),
    ("demo --out /proc/results", "cannot write to the folder '/proc/results'"),
    ("explore paper --export page.html --port 8000", "--port has no meaning"),
    ("validate verify --quick --out ''", "--out is empty: give it a value, or leave it out"),
    ("verify --quick", "verify is a study of validation: type magtip validate verify"),
    ("--depth 1", "size, solve, converge, ...; type magtip to see all"),
    ("friction --quick", "friction is a part of the study verify: type magtip validate verify friction"),
    ("validate trade", "trade is a part of the study errors: type magtip validate errors trade"),
    (
        "validate errors claims",
        "errors has no part claims: choose one of accuracy, crosscheck, estimates, trade, vib",
    ),
    ("validate errors trade --tilted", "--tilted is an option of crosscheck: leave it out, or choose this part"),
    (
        "sweep --axis D=6,8 --depth 1 --workers 1 --scheduler x",
        "--workers is for processes on this machine and --scheduler for a cluster: give one of them",
    ),
]


@pytest.mark.parametrize(("line", "sentence"), BAD)
def test_bad_input_is_one_sentence(refusal, tmp_path, line, sentence):
    assert sentence in refusal(*shlex.split(line))
    assert not list(tmp_path.iterdir())


def test_a_bug_is_not_hidden(run, monkeypatch):
    def bug(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(load_cases, "analytic", bug)
    with pytest.raises(ZeroDivisionError):
        run("analytic", "paper", "--depth", 1)


def started(*tokens, path=ROOT, **options):
    """A command line in a process of its own."""
    command = [sys.executable, "-m", "studies.cli", *tokens]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, {path: 0, ROOT: 0}))}
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, **options)


def test_interrupt_keeps_what_was_reached(tmp_path, strict):
    depths = ",".join(f"{0.2 * k:g}" for k in range(1, 40))
    words = ("solve", "paper", "--depths", depths, "--json", "--out", "last.vtu", *QUICK)
    with started(*words, stdout=subprocess.PIPE, cwd=tmp_path) as process:
        # the first state is here before the last one is solved
        first = process.stdout.readline()
        process.send_signal(signal.SIGINT)
        rest, err = process.communicate()
    assert (process.returncode, err) == (INTERRUPTED, "magtip: interrupted; any complete files are kept\n")
    reached = strict(first + rest)
    assert 1 <= len(reached) < 39
    assert {state["status"] for state in reached} == {"ok"}
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["last.vtu"]


def test_an_interrupt_while_the_command_is_loaded_is_a_sentence(tmp_path):
    """Here something of a library's name takes a minute to load, and does not let an interruption through."""
    (tmp_path / "cyclopts.py").write_text(
        "import sys, time\nprint('loading', file=sys.stderr)\ntry: time.sleep(60)\n"
        "except BaseException: raise ImportError('half loaded')\n"
    )
    with started("design", "paper", path=tmp_path) as process:
        assert process.stderr.readline() == "loading\n"
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == "magtip: interrupted before anything was begun\n"
    assert process.returncode == INTERRUPTED


def loaded_by(*tokens):
    """The names of all modules that a process has imported when a command line ends."""
    code = "import sys; from studies.cli import main; main(sys.argv[1:]); print('loaded', *sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code, *tokens], capture_output=True, check=True).stdout.decode()
    return set(shown.splitlines()[-1].split())


def test_help_imports_little():
    slow = {"numpy", "scipy", "skfem", "numba", "pygments", "difflib", "studies.simulation", "studies.sensing"}
    assert not loaded_by("--help") & (HEAVY | slow)


def test_the_interface_from_python_imports_little():
    code = "import magtip; magtip.paper(); import sys; print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True, cwd=ROOT).stdout
    assert not {"numpy", "numba", "asyncio", "difflib", "studies", "fem"} & set(shown.split())


def test_a_press_imports_what_it_needs():
    loaded = loaded_by("solve", "paper", "--depth", "0.1", "--json", *QUICK)
    assert {"fem.equilibrium", "scipy.spatial"} <= loaded
    # what runs only where it is used; of a deferred module the name is there, but nothing that it imports itself
    deferred = {"numpy.f2py.crackfortran", "numpy.testing._private", "scipy.spatial.transform._rotation"}
    other_work = {"geometry.mesh", "fem.analyses.modes", "studies.cli.sensing_commands"}
    libraries = {"rich", "scipy.optimize", "scipy.stats", "scipy.interpolate", "platformdirs", "asyncio"}
    assert not loaded & (HEAVY | deferred | other_work | libraries)


def test_a_reader_that_goes_away():
    with started("design", "paper", "--json", stdout=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == BROKEN_PIPE


def test_json_line_has_no_nan(strict):
    record = {"a": float("nan"), "b": [float("inf"), 1.0], "c": (1, "x", None, True)}
    assert "-0" not in atomic_files.json_line({"force_N": (-0.0, 0.0), "tilt_rad": -0.0})
    assert strict(atomic_files.json_line(record)) == [{"a": None, "b": [None, 1.0], "c": [1, "x", None, True]}]


def test_a_negative_number_may_come_first(run, refusal, strict):
    (record,) = strict(run("readings", "paper", "--shift", "-1,0,-.5", "--tilt", "-0.1,0", "--json")[1])
    assert (record["shift_mm"], record["rotation_rad"]) == ([-1, 0, -0.5], [-0.1, 0])
    assert "--shift" in refusal("readings", "paper", "--shift", "--tilt", "-0.1,0")


NEEDED = {
    "cad": "--out a",
    "board": "--out a",
    "mesh": "--out a",
    "analytic": "--depth 1",
    "field": "--points a",
    "table": "--out a",
}
NEEDED |= {"stream": "--port a", "firmware": "--out a", "size": "--out a", "sensitivity": "--depth 1"}


def test_a_value_too_many_is_a_sentence(run, tmp_path):
    # the word after store or validate is one of its actions, and calibrate takes any number of files
    others = ("store", "validate", "calibrate")
    verbs = [name for name in app if not name.startswith("-") and name not in others]
    for verb in (*verbs, "validate verify", "validate bench"):
        # the word after catalogue is one of its kinds
        word = "magnets" if verb == "catalogue" else "first"
        status, out, err = run(*verb.split(), word, "t2.csv", "my", *NEEDED.get(verb, "").split())
        assert (status, out) == (2, "")
        taken, _, surplus = err.partition(": leave out ")
        first = "" if "takes one" in taken else f"{word!r}, "
        assert surplus == f"{first}'t2.csv', 'my', or quote a value that has spaces\n"
        assert re.fullmatch(f"magtip: {verb} takes (one [A-Z]+ and options|options only)", taken)
    assert not list(tmp_path.iterdir())


def test_what_is_set_in_vain_is_said(run):
    status, _, err = run("readings", "paper", "--set", "mooney_share=0.5", "--json")
    assert (status, err) == (0, "magtip: warning: mooney_share has no effect: the law is neo-hookean\n")


# The verbs as --help lists them, and the options, keys and commands on which users depend.


ORDER = """
    Design: design cad board mesh catalogue size
    Simulation: solve converge analytic stability modes compare response cycle fit
    Sensing: field readings bench calibrate decode stream firmware table layout disturb array
    Exploration: sweep sensitivity demo report explore help store
    Validation: validate
    Options: --help --version
"""


def test_help_lists_the_verbs_in_groups_from_a_design_to_its_validation(run):
    text = run("--help")[1]
    listed = re.findall(r"^╭─ (\w+) |^│ ([-\w]+)", text, re.MULTILINE)
    assert [title + ":" if title else verb for title, verb in listed] == ORDER.split()


def test_without_a_verb_the_list_is_followed_by_five_commands_to_try(run):
    status, text, _ = run()
    listed, _, tries = text.partition("Five things to try:\n")
    assert (status, listed) == (0, run("--help")[1])
    lines = re.findall(r"^  magtip (\S.*?)(?: > \S+)?  +\w.*$", tries, re.MULTILINE)
    assert len(lines) == 5 == tries.count("\n")
    assert all(
        callable(app.parse_args(shlex.split(line), exit_on_error=False, print_error=False)[0]) for line in lines
    )
    assert max(map(len, tries.splitlines())) <= 80


def test_help_prints_what_the_option_prints_and_opens_the_page_where_the_site_is(run, tmp_path, monkeypatch):
    assert run("help") == run("--help")
    monkeypatch.setattr(exploration_commands, "SITE", tmp_path)
    status, printed, said = run("help", "store")
    assert (status, printed) == run("store", "--help")[:2]
    assert "`make docs`" in said
    assert str(tmp_path) in "".join(said.split())
    unknown = run("help", "solv")
    assert (unknown[0], unknown[2]) == (2, run("solv")[2])
    page = tmp_path / "docs" / "reference" / "verb" / "modes.html"
    page.parent.mkdir(parents=True)
    page.touch()
    opened = []
    monkeypatch.setattr(webbrowser, "open", lambda address: opened.append(address) or len(opened) == 1)
    assert run("help", "modes") == (0, f"{page}\n", "")
    assert opened == [page.as_uri()]
    # no browser
    status, printed, said = run("help", "modes")
    assert (status, printed) == run("modes", "--help")[:2]
    assert str(page) in "".join(said.split())


def test_validate_lists_its_studies(run):
    listed = re.findall(r"^│ ([-\w]+)", run("validate")[1], re.MULTILINE)
    assert listed == ["bench", "devices", "errors", "formulas", "surrogate", "verify"]


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
STATE = json.dumps({"status": "ok"})
TEST = "stretch,nominal_stress_MPa\n" + "".join(f"{1 + k / 10},{k / 10}\n" for k in range(1, 8))
DESIGN = "E = 0.6\n"


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.csv", POINTS, "field paper --points a.csv --out a.csv"),
        ("a.csv", STATE, "decode paper --file p.csv --responses a.csv --out a.csv"),
        ("t.json", STATE, "table paper --responses t.json --out t.npy"),
        ("a.vtu", DESIGN, "mesh a.vtu --out a.vtu"),
        ("a.vtu", "", "solve paper --depth 1 --mesh a.vtu --out a.vtu"),
        ("fit.csv", TEST, "fit fit.csv --out ."),
        ("sweep.csv", DESIGN, "sweep sweep.csv --axis depth=0.5 --out ."),
        ("beam.step", DESIGN, "cad beam.step --out ."),
    ],
)
def test_an_output_onto_an_input_is_bad_input(refusal, tmp_path, name, text, line):
    (tmp_path / name).write_text(text)
    (tmp_path / "p.csv").write_text(POINTS)
    assert re.search(
        f"the output '{name}' is also the input '{name}'|'{name}' was not written by magtip", refusal(*line.split())
    )
    assert (tmp_path / name).read_text() == text
    assert {file.name for file in tmp_path.glob("[!.]*")} == {name, "p.csv"}


# The commands that results print: they are parsed to what was asked for, and one run again gives the same table.


LINES = [
    "stability paper --slenderness 1,2 --magnet ignored --accuracy quick --set E=0.6 --set nu=0.45 --out out/s",
    "layout paper --search --range f=5,8 --range l0=9 --count 3 --claim --level tip --clearance 0.2 --ignore-tilt",
    "layout design.toml --responses states.jsonl --mode magnitude --set hall_layout=tmag5273a1",
    "validate verify --quick --out 'a folder/with it'\"'\"'s quote'",
    "validate errors crosscheck --accuracy standard --tilted",
    "validate bench --quick --cases field",
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


def test_the_command_in_a_page_makes_that_page_again(run, tmp_path):
    """STABILITY.md, of a design and with fields that are not the paper's."""
    (tmp_path / "my design.toml").write_text("E = 2.0\n", "utf-8")
    flags = ("--slenderness", "1.5", "--magnet", "ignored", "--accuracy", "quick", "--set", "nu=0.45")
    assert run("stability", "my design.toml", *flags, "--out", "s")[0] == 0
    asked = re.findall(r"Made with `magtip ([^`]*)`", (tmp_path / "s" / "STABILITY.md").read_text("utf-8"))[-1]
    assert {"my design.toml", "nu=0.45", "ignored", "quick"} <= set(shlex.split(asked))
    table = (tmp_path / "s" / "stability.csv").read_bytes()
    (tmp_path / "s" / "stability.csv").unlink()
    assert run(*shlex.split(asked))[0] == 0
    assert (tmp_path / "s" / "stability.csv").read_bytes() == table


# Standard streams that are full, closed or broken: one sentence, no traceback, and the right exit status.


FULL = "magtip: cannot write to standard output (No space left on device): redirect it elsewhere\n"


def shell(redirection, *tokens, **more):
    """Run a command line with a shell's redirection."""
    command = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-m", "studies.cli", *tokens]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, **more)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("redirection", "design", "status", "err"),
    [(">/dev/full", "paper", 2, FULL), ("2>&-", "papre", 2, ""), ("2>/dev/full", "papre", 2, "")],
)
def test_a_full_output_is_named_and_what_cannot_be_said_does_not_change_the_status(redirection, design, status, err):
    run = shell(redirection, "design", design, "--json")
    assert (run.returncode, run.stdout, run.stderr) == (status, "", err)


def test_a_closed_standard_output_leads_nowhere(tmp_path):
    """Nothing that is printed may end in a file that gets the number of the closed stream."""
    run = shell(">&-", "table", "paper", "--step", "1", "--plane", "--out", "t.npy", cwd=tmp_path)
    assert (run.returncode, (tmp_path / "t.npy").read_bytes()[:6]) == (0, b"\x93NUMPY")


def test_a_name_that_is_no_text_is_a_sentence_and_spoils_no_report(refusal, run, tmp_path):
    name = os.fsdecode(b"a\xffb")
    assert "'a\\udcffb.toml' is not UTF-8: rename the file" in refusal("design", f"{name}.toml")
    assert "is not UTF-8" in refusal("cad", "paper", "--out", name)
    folder = tmp_path / "results"
    (folder / name).mkdir(parents=True)
    (folder / name / "sweep.csv").write_text("a\n1\n")
    (folder / f"{name}.csv").write_text("a\n1\n")
    (folder / "press.csv").write_text("depth_mm,fem_force_N,analytic_force_N,status\n1,2,3,ok\n")
    status, _, err = run("report", folder)
    assert status == 0
    assert err.count("'a\\udcffb.csv' was not read: its name is not UTF-8") == 1
    assert err.count("'a\\udcffb' was not read") == 1


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EACCES, errno.EISDIR, errno.EAGAIN, errno.ECONNREFUSED, None])
def test_only_errors_of_files_have_a_remedy(number, monkeypatch, capsys):
    """Any other error of the system is a bug, whose traceback says where it is."""

    def fails(stream):
        raise OSError(number, "text", "there")

    monkeypatch.setattr(commands.console, "Output", fails)
    if number in (errno.ENOSPC, errno.EACCES, errno.EISDIR):
        assert commands.run(["design", "paper"]) == 2
        assert f"cannot write or read 'there' (text): {commands.OF_FILES[number]}\n" in capsys.readouterr().err
    else:
        with pytest.raises(OSError, match="text"):
            commands.run(["design", "paper"])
