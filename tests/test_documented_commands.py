"""Commands and Python snippets in the documents run, and print what stands below them.

A block `console` holds commands after `$`, each with its output; a block `text` is the output of the block `python`
before it; a block `toml` whose first line is a comment with a name is written to that file first. Numbers are
compared to the digits that are printed, spaces are not, and a line `...` stands for any lines.

Own code, because none of the packages for this knows all three forms: pytest-codeblocks compares no numbers and runs
shells, Sybil wants parsers for each form that are as long as this file, and each is one more dependency.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

from studies.cli import commands, entry_point
from studies.inputs import study_input, user_input

ROOT = Path(__file__).resolve().parent.parent
READMES = [ROOT / name / "README.md" for name in (".", "geometry", "fem", "analytic", "studies", "results")]
READMES += [*sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "explanation").glob("*.md"))]
COMPILED = ROOT / "studies" / "examples" / "TUTORIAL.md"
TUTORIALS = [*sorted((ROOT / "docs" / "tutorials").glob("[!i]*.md")), COMPILED]
FENCE = re.compile(r"^( *)```(\w+)\n(.*?)^\1```$", flags=re.M | re.S)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
INLINE = re.compile(r"`((?:magtip|python -m) [^`]+)`")

INSTEAD = {"make demo": "make -n demo", "make test": "make -n test"}
"""What is run for a command that takes minutes: `make -n` prints the commands without running them. The job of the
demo runs on few states in test_demo.py, and `make test` is what runs this file."""


@dataclass(frozen=True)
class Block:
    path: Path
    number: int
    kind: str
    text: str
    output: str | None


def blocks(path):
    """Fenced blocks of a document; the output of a snippet belongs to it."""
    parts = []
    for number, (indent, kind, text) in enumerate(FENCE.findall(path.read_text("utf-8"))):
        text = "".join(line.removeprefix(indent) for line in text.splitlines(keepends=True))
        if kind == "text" and parts and parts[-1].kind == "python":
            parts[-1] = Block(path, parts[-1].number, "python", parts[-1].text, text)
        else:
            parts.append(Block(path, number, kind, text, None))
    return parts


BLOCKS = [block for path in READMES for block in blocks(path)]


def name(path):
    return path.relative_to(ROOT).with_suffix("").as_posix()


def of_kind(*kinds):
    chosen = [block for block in BLOCKS if block.kind in kinds]
    return pytest.mark.parametrize("block", chosen, ids=lambda block: f"{name(block.path)}-{block.number}")


def commands_of(block):
    """Each command after $, with its output; in a block `sh` all lines are commands, without output."""
    if block.kind == "sh":
        return [(line.partition("#")[0].strip(), None) for line in block.text.splitlines()]
    parts = re.split(r"^\$ ", block.text, flags=re.M)
    assert not parts[0], "a block console begins with $"
    return [tuple(part.partition("\n")[::2]) for part in parts[1:]]


def close(shown, printed):
    """Whether a number is the one that is shown, to its last digit."""
    mantissa, _, power = shown.lower().partition("e")
    digit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= 1.001 * digit


def same_line(shown, printed):
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", printed).split():
        return False
    return all(map(close, NUMBER.findall(shown), NUMBER.findall(printed)))


def same(shown, printed):
    """Whether lines are as they are shown, with `...` for any lines."""
    if not shown:
        return not printed
    if shown[0] == "...":
        return any(same(shown[1:], printed[k:]) for k in range(len(printed) + 1))
    return bool(printed) and same_line(shown[0], printed[0]) and same(shown[1:], printed[1:])


def lines(text):
    return [line for line in text.splitlines() if line.strip()]


def test_numbers_count_to_their_last_digit():
    assert same(["F 4.187 N", "...", "end"], ["F  4.1874 N", "x", "y", "end"])
    assert not same(["F 4.187 N"], ["F 4.189 N"])
    assert not same(["F 4.187 N"], ["F 4.187 mN"])
    assert not same(["F 4.187 N"], ["F 4.187 N", "more"])
    assert same(["1e-05"], ["1.4e-05"])
    assert not same(["1e-05"], ["3e-05"])


def files_of(path, folder):
    """Write the files that a document shows."""
    for block in blocks(path):
        if block.kind == "toml" and (first := re.match(r"# (\S+\.toml)\n", block.text)):
            (folder / first[1]).write_text(block.text, encoding="utf-8")


@of_kind("console", "sh")
def test_command_prints_what_is_shown(block, capsys, tmp_path, monkeypatch):
    files_of(block.path, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for command, output in commands_of(block):
        program, *tokens = shlex.split(INSTEAD.get(command, command))
        if program == "make":
            assert shutil.which("make"), "the set-up needs make"
            done = subprocess.run(["make", *tokens], cwd=ROOT, capture_output=True, text=True, check=True)
            assert re.search(r"\bmagtip demo --out out/demo|\bpytest\b", done.stdout)
            continue
        assert program == "magtip", command
        assert entry_point.main(tokens) == 0, command
        assert same(lines(output), lines(capsys.readouterr().out)), command


def run_shown(command, capsys):
    """What a command of the tutorial prints on standard output, run where it stands."""
    words, _, given = command.partition(" < ")
    program, *tokens = shlex.split(words)
    if program == "magtip":
        assert entry_point.main(tokens) == 0, command
        return capsys.readouterr().out
    program = sys.executable if program == "python" else program
    with open(given or os.devnull, encoding="utf-8") as source:
        done = subprocess.run([program, *tokens], stdin=source, capture_output=True, text=True, check=True)
    return done.stdout


NEEDS_GCC = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="the tutorial compiles the decoder: gcc is missing"
)


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.calibrates, NEEDS_GCC] if path == COMPILED else ()) for path in TUTORIALS],
    ids=name,
)
def test_tutorial_prints_what_it_shows(path, capsys, tmp_path, monkeypatch):
    """Its commands and snippets follow each other in one folder, with the files and the names that it has made."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    names = {"__name__": "snippet"}
    for block in blocks(path):
        if block.kind == "c":
            Path(re.match(r"/\* (\S+):", block.text)[1]).write_text(block.text, encoding="utf-8")
        elif block.kind == "python":
            run_snippet(block, names)
        else:
            assert block.kind == "console"
            for command, output in commands_of(block):
                assert same(lines(output), lines(run_shown(command, capsys))), command
    pictures = re.findall(r"!\[[^]]*\]\((\w+\.\w+)\)", path.read_text("utf-8"))
    assert [picture for picture in pictures if not Path(picture).exists()] == []


def run_snippet(block, names):
    """Run a snippet with names that it may add to, and compare what it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(block.text, str(block.path), "exec"), names)
    assert same(lines(block.output or ""), lines(printed.getvalue()))


@of_kind("python")
def test_snippet_prints_what_is_shown(block):
    assert block.output is not None, "show what it prints in a block `text`"
    run_snippet(block, {"__name__": "snippet"})


@of_kind("toml")
def test_file_is_a_design_or_a_study(block, tmp_path):
    files_of(block.path, tmp_path)
    (path,) = [str(file) for file in tmp_path.glob("[!.]*") if file.read_text("utf-8") == block.text]
    if "axes" in tomllib.loads(block.text):
        assert study_input.read_study(path).axes
    else:
        assert user_input.read_design(path)


def test_no_other_blocks():
    """A block of another kind would be shown and never run."""
    assert {block.kind for block in BLOCKS} <= {"console", "sh", "python", "toml"}
    fences = sum(re.sub(r"```\{.*?```", "", path.read_text("utf-8"), flags=re.S).count("```") for path in READMES)
    assert fences == 2 * sum(1 + (block.output is not None) for block in BLOCKS)


def inline():
    return sorted({command for path in READMES + TUTORIALS for command in INLINE.findall(path.read_text("utf-8"))})


@pytest.mark.parametrize("command", inline())
def test_command_within_text_is_understood(command):
    """Its verb and options are there, its values are of their kinds; it is not run."""
    program, *tokens = shlex.split(command)
    if program == "python":
        place = ROOT.joinpath(*tokens[1].split("."))
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists()
    elif len(tokens) == 1:
        assert tokens[0] in commands.app
    else:
        assert callable(commands.app.parse_args(tokens, exit_on_error=False, print_error=False)[0])
