"""The command line: its contract of flags, JSON keys and exit statuses, and one sentence for all bad input."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from test_layers import HEAVY

from studies.output import atomic_files, vtk_files
from studies.output.result import BROKEN_PIPE, INTERRUPTED
from studies.simulation import load_cases

ROOT = Path(__file__).resolve().parent.parent
QUICK = ("--magnet", "ignored", "--accuracy", "quick")


BAD = [
    ("solve", "paper"),
    ("solve", "papre", "--depth", 1),
    ("validate", "verify", "--quick", "--out", ""),
    ("explore", "paper", "--export", "page.html", "--port", 8000),
    ("solve", "paper", "--depth", "nan"),
    ("solve", "paper", "--depth", "-1"),
    ("solve", "paper", "--depth", "one"),
    ("solve", "paper", "--depth"),
    ("solve", "paper", "--depth", 1, "--depth", 2),
    ("solve", "paper", "--depth", 7.5),
    ("solve", "paper", "--depth", 9, "--magnet", "ignored"),
    ("solve", "paper", "--depth", 1, "--magnet", "soft"),
    ("solve", "paper", "--depth", 1, "--set", "magnet_diameter=0", "--set", "magnet_height=0"),
    ("solve", "paper", "--depth", 1, "--depths", "1,2"),
    ("solve", "paper", "--depths", "1,,2"),
    ("solve", "paper", "--depths", ""),
    ("solve", "paper", "--depths", "1,2", "--steps", 2),
    ("solve", "paper", "--depths", "1,2", "--shear", 1),
    ("solve", "paper", "--depth", 1, "--steps", 0),
    ("solve", "paper", "--depth", 1, "--steps", "nan"),
    ("solve", "paper", "--depth", 1, "--steps", 1e9),
    ("solve", "paper", "--depth", 1, "--shear", "inf"),
    ("solve", "paper", "--depth", 1, "--shear", 100),
    ("solve", "paper", "--depth", 0, "--shear", 1),
    ("solve", "paper", "--depth", 1, "--friction", "glue"),
    ("solve", "paper", "--depth", 1, "--friction", -0.1),
    ("solve", "paper", "--depth", 1, "--friction", "nan"),
    ("solve", "paper", "--shear", 1),
    ("solve", "paper", "--grip", 2),
    ("solve", "paper", "--grip", 0, "--shear", 1),
    ("solve", "paper", "--grip", 9, "--shear", 1),
    ("solve", "paper", "--grip", 1e-9, "--shear", 1),
    ("solve", "paper", "--grip", 1e-3, "--shear", 1),
    ("solve", "paper", "--grip", 2, "--shear", 1, "--depth", 1),
    ("solve", "paper", "--depth", 1, "--imperfection", 50),
    ("solve", "paper", "--grip", 2, "--shear", 1, "--friction", "stick"),
    ("solve", "paper", "--grip", 2, "--shear", 1, "--plate-tilt", 5),
    ("solve", "paper", "--depth", 1, "--shear-y", "inf"),
    ("solve", "paper", "--depths", "1,2", "--shear-y", 1),
    ("solve", "paper", "--depth", 1, "--harmonics", 3),
    ("solve", "paper", "--depth", 1, "--shear", 1, "--harmonics", 0),
    ("solve", "paper", "--depth", 1, "--shear", 1, "--harmonics", -1),
    ("solve", "paper", "--depth", 1, "--shear", 1, "--harmonics", 13),
    ("solve", "paper", "--depth", 1, "--shear", 1, "--harmonics", 2, "--model", "half"),
    ("solve", "paper", "--depth", 1, "--plate-tilt", 50),
    ("solve", "paper", "--depth", 1, "--plate-tilt", "nan"),
    ("solve", "paper", "--depth", 1, "--plate-tilt", 5, "--model", "axisymmetric"),
    ("solve", "paper", "--depth", 1, "--plate-tilt", 5, "--shear-y", 1, "--model", "half"),
    ("solve", "paper", "--depth", 1, "--model", "spherical"),
    ("solve", "paper", "--depth", 1, "--shear", 1, "--model", "axisymmetric"),
    ("solve", "paper", "--depth", 1, "--accuracy", "best"),
    ("solve", "paper", "--depth", 1, "--out", "field.txt"),
    ("solve", "paper", "--depth", 1, "--out", "/proc/nowhere/field.vtu"),
    ("solve", "paper", "--depth", 1, "--out", "/proc/field.vtu"),
    ("solve", "paper", "--depth", 1, "--picture", "field.jpg"),
    ("analytic", "paper"),
    ("analytic", "paper", "--depth", 5),
    ("analytic", "paper", "--depth", "nan"),
    ("analytic", "paper", "--depth", 1, "--level", "best"),
    ("design",),
    ("design", "paper", "extra"),
    ("cad", "paper"),
    ("cad", "paper", "--out", "/proc/parts"),
    ("mesh", "paper", "--out", "mesh.msh"),
    ("mesh", "paper", "--out", "mesh.vtu", "--size", 0),
    ("mesh", "paper", "--out", "mesh.vtu", "--size", "nan"),
    ("mesh", "paper", "--out", "mesh.vtu", "--size", 0.01),
    ("sweep",),
    ("sweep", "paper"),
    ("sweep", "paper", "--axis", "D=6,8"),
    ("sweep", "paper", "--axis", "depth=1", "--depth", 1),
    ("sweep", "paper", "--axis", "D=6,8", "--depth", "nan"),
    ("sweep", "paper", "--design", "paper", "--axis", "D=6,8", "--depth", 1),
    ("sweep", "paper", "--axis", "D=8", "--depth", 1, "--set", "D=9"),
    ("stability", "paper", "--slenderness", 1e9),
    ("stability", "paper", "--slenderness", 1e6),
    ("stability", "paper", "--slenderness", 0),
    ("stability", "paper", "--slenderness", -1),
    ("stability", "paper", "--slenderness", "nan"),
    ("stability", "paper", "--depth", 7),
    ("modes", "paper", "--depth", 7),
    ("compare", "papre"),
    ("compare", "paper", "--out", "/proc/results"),
    ("demo", "--out", "/proc/results"),
    ("slove",),
    ("--depth", 1),
]


@pytest.mark.parametrize("tokens", BAD, ids=lambda tokens: " ".join(map(str, tokens)))
def test_bad_input_is_one_sentence(refusal, tmp_path, tokens):
    err = refusal(*tokens)
    assert err.endswith("\n")
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("tokens", "part"),
    [
        (("slove",), 'Did you mean "solve"?'),
        (("solve", "paper", "--dpeth", 1), "did you mean --depth?"),
        (
            ("compare", "paper", "--depth", 1),
            "choose one of --out, --accuracy, --tolerance, --frequency, --speed, --set, --wide, --json",
        ),
        (("solve", "papre", "--depth", 1), "did you mean paper?"),
        (("design", "paper", "--set", "magnet_hieght=3"), "did you mean magnet_height?"),
        (("solve", "paper", "--depth", 1, "--accuracy", "best"), '"quick", "standard", "fine"'),
        (("solve", "paper", "--depth", 7.5), "less than 7 mm, the silicone"),
        (("solve",), "solve needs DESIGN: add it behind the verb"),
        (("analytic", "paper"), "analytic needs --depth: add --depth and its value"),
        (("cad", "paper", "--axis", "--out", "m"), "cad: --axis needs a value"),
    ],
)
def test_remedies(run, tokens, part):
    assert part in run(*tokens)[2]


def test_study_and_axes_exclude_each_other(run, tmp_path):
    (tmp_path / "study.toml").write_text("[axes]\nD = [6, 8]\n")
    assert "leave --axis out" in run("sweep", "study.toml", "--axis", "E=1,2", "--depth", 1)[2]
    assert "needs a depth" in run("sweep", "study.toml")[2]


def test_a_bug_is_not_hidden(run, monkeypatch):
    def bug(*_, **__):
        raise ZeroDivisionError

    monkeypatch.setattr(load_cases, "analytic", bug)
    with pytest.raises(ZeroDivisionError):
        run("analytic", "paper", "--depth", 1)


def test_interrupt_keeps_what_was_reached(tmp_path, strict):
    depths = ",".join(f"{0.2 * k:g}" for k in range(1, 40))
    command = ["solve", "paper", "--depths", depths, "--json", "--out", "last.vtu", *QUICK]
    code = "import sys; from studies.cli import main; sys.exit(main(sys.argv[1:]))"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "cwd": tmp_path, "text": True}
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    with subprocess.Popen(
        [sys.executable, "-c", code, *command], env={**os.environ, "PYTHONPATH": path}, **pipes
    ) as run:
        # the first state is here before the last one is solved
        first = run.stdout.readline()
        run.send_signal(signal.SIGINT)
        rest, err = run.communicate()
    assert (run.returncode, err) == (INTERRUPTED, "magtip: interrupted; any complete files are kept\n")
    reached = strict(first + rest)
    assert 1 <= len(reached) < 39
    assert {state["status"] for state in reached} == {"ok"}
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["last.vtu"]


@pytest.mark.parametrize("loses", ["pass", "raise ImportError('half loaded')"])
def test_an_interrupt_while_the_command_is_loaded_is_a_sentence(tmp_path, loses):
    """Here something of a library's name takes a minute to load, and does not let an interruption through."""
    (tmp_path / "cyclopts.py").write_text(
        f"import sys, time\nprint('loading', file=sys.stderr)\ntry: time.sleep(60)\nexcept BaseException: {loses}\n"
    )
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    options = {"env": {**os.environ, "PYTHONPATH": paths}, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-m", "studies.cli", "design", "paper"], **options) as process:
        assert process.stderr.readline() == "loading\n"
        process.send_signal(signal.SIGINT)
        assert process.stderr.read() == "magtip: interrupted before anything was begun\n"
    assert process.returncode == 130


@pytest.mark.parametrize(("field", "status"), [("E=0.6", 0), ("E=-1", 2)])
def test_the_module_of_the_command_runs_it(tmp_path, strict, field, status):
    tokens = [sys.executable, "-m", "studies.cli", "design", "paper", "--set", field, "--json"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(tokens, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == status
    assert len(strict(ended.stdout)) == (status == 0)


def test_full_disk_is_a_sentence(run, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device", "field.vtu")

    monkeypatch.setattr(vtk_files, "write_field", full)
    status, out, err = run("solve", "paper", "--depth", 0.5, "--json", "--out", "field.vtu", *QUICK)
    # the state was printed before its file was to be written
    assert (status, out.count("\n"), err.count("\n")) == (2, 1, 1)
    assert "No space left on device" in err


def loaded_by(*tokens):
    """What a command line prints, and the names of all modules that a process has imported at its end."""
    code = (
        "import sys; from studies.cli import main; status = main(sys.argv[1:]);"
        "print('loaded', *sys.modules); sys.exit(status)"
    )
    shown = subprocess.run([sys.executable, "-c", code, *tokens], capture_output=True, check=True).stdout.decode()
    *lines, last = shown.splitlines()
    return "\n".join(lines), set(last.split())


def test_help_imports_little():
    shown, loaded = loaded_by("--help")
    slow = {"numpy", "scipy", "skfem", "numba", "pygments", "difflib", "studies.simulation", "studies.sensing"}
    assert not loaded & (HEAVY | slow)
    for verb in ("demo", "design", "cad", "mesh", "solve", "analytic", "compare", "sweep"):
        assert verb in shown


def test_a_press_imports_what_it_needs():
    _, loaded = loaded_by("solve", "paper", "--depth", "0.1", "--json", *QUICK)
    assert {"fem.equilibrium", "scipy.spatial"} <= loaded
    # what runs only where it is used; of a deferred module the name is there, but nothing that it imports itself
    deferred = {"numpy.f2py.crackfortran", "numpy.testing._private", "scipy.spatial.transform._rotation"}
    other_work = {
        "geometry.mesh",
        "fem.analyses.modes",
        "studies.cli.sensing_commands",
        "studies.cli.validation_commands",
    }
    libraries = {"rich", "scipy.optimize", "scipy.stats", "scipy.interpolate", "platformdirs", "asyncio"}
    assert not loaded & (HEAVY | deferred | other_work | libraries)


def test_a_reader_that_goes_away():
    code = "import sys; from studies.cli import main; sys.exit(main(['design', 'paper', '--json']))"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == BROKEN_PIPE


def test_json_line_has_no_nan(strict):
    record = {"a": float("nan"), "b": [float("inf"), 1.0], "c": (1, "x", None, True)}
    assert "-0" not in atomic_files.json_line({"force_N": (-0.0, 0.0), "tilt_rad": -0.0})
    assert strict(atomic_files.json_line(record)) == [{"a": None, "b": [None, 1.0], "c": [1, "x", None, True]}]


def test_a_negative_number_may_come_first(run, refusal, strict):
    (record,) = strict(run("readings", "paper", "--shift", "-1,0,-.5", "--tilt", "-0.1,0", "--json")[1])
    assert (record["shift_mm"], record["rotation_rad"]) == ([-1, 0, -0.5], [-0.1, 0])
    assert "--shift" in refusal("readings", "paper", "--shift", "--tilt", "-0.1,0")


def test_a_value_too_many_is_a_sentence(run, tmp_path):
    from studies.cli.commands import app

    needed = {
        "cad": ("--out", "a"),
        "mesh": ("--out", "a"),
        "analytic": ("--depth", 1),
        "field": ("--points", "a"),
        "table": ("--out", "a"),
        "stream": ("--port", "a"),
        "firmware": ("--out", "a"),
        "size": ("--out", "a"),
        "sensitivity": ("--depth", 1),
    }
    # the word after store or validate is one of its actions, and calibrate takes any number of files
    others = ("store", "validate", "calibrate")
    verbs = [(name,) for name in app if not name.startswith("-") and name not in others]
    for verb, *study in (*verbs, ("validate", "verify"), ("validate", "assumption")):
        # the word after catalogue is one of its kinds
        word = "magnets" if verb == "catalogue" else "first"
        status, out, err = run(verb, *study, word, "t2.csv", "my", *needed.get(verb, ()))
        assert (status, out) == (2, "")
        taken, _, surplus = err.partition(": leave out ")
        first = "" if "takes one" in taken else f"{word!r}, "
        assert surplus == f"{first}'t2.csv', 'my', or quote a value that has spaces\n"
        takes = (
            "options only",
            *(f"one {name} and options" for name in ("DESIGN", "FILE", "STUDY", "DIR", "REQUIREMENTS", "KIND")),
        )
        assert taken in {f"magtip: {' '.join((verb, *study))} takes {what}" for what in takes}
    assert not list(tmp_path.iterdir())


def test_help_says_which_columns_a_table_has(run):
    for verb in ("solve", "sweep"):
        text = " ".join(run(verb, "--help")[1].replace("│", "").split())
        assert "default: as many main columns as fit" in text


@pytest.mark.parametrize("count", ["2.5", "1e1", "two"])
def test_a_count_is_not_rounded(refusal, count):
    err = refusal("validate", "range", "--count", count)
    assert err.endswith(f"--count must be a whole number; got {count}\n")


AT_REST = "these readings may be those of a sensor at rest whose parts lie within tolerances: calibrate the sensor"


@pytest.mark.parametrize(
    ("verb", "more"),
    [
        (("analytic", "--depth", 1), ""),
        (("readings",), ""),
        (("decode", "--readings", "2.87,2.79,2.79"), f"magtip: warning: {AT_REST}\n"),
    ],
)
def test_what_is_set_in_vain_is_said(run, verb, more):
    status, _, err = run(verb[0], "paper", *verb[1:], "--set", "mooney_share=0.5", "--json")
    assert (status, err) == (0, f"magtip: warning: mooney_share has no effect: the law is neo-hookean\n{more}")


def test_options_that_take_whole_numbers_say_so(run):
    from fem.scene import MOST_HARMONICS

    text = run("solve", "--help")[1]
    assert f"0 to {MOST_HARMONICS} (a shear needs 1 or more)" in " ".join(text.replace("│", "").split())
    for option in ("--steps", "--harmonics"):
        assert re.search(rf"{option} +INT", text)
