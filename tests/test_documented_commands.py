"""Commands and Python snippets in the documents run, and print what stands below them."""

import re
import shlex
import shutil
import subprocess
import tomllib

import pytest

from docs import documented_commands, notebooks
from docs.documented_commands import PICTURES, ROOT, TUTORIALS, blocks, same
from studies.cli import commands
from studies.inputs import study_input, user_input

READMES = [ROOT / name / "README.md" for name in (".", "geometry", "fem", "analytic", "studies", "results")]
READMES += [path for path in sorted((ROOT / "docs").glob("*.md")) if path != PICTURES]
READMES += sorted((ROOT / "docs" / "explanation").glob("*.md")) + sorted((ROOT / "docs" / "verbs").glob("*.md"))
COMPILED = ROOT / "docs" / "tutorials" / "bench_to_robot.md"
INLINE = re.compile(r"`((?:magtip|python -m) [^`]+)`")

INSTEAD = {"make demo": "make -n demo", "make test": "make -n test"}
"""What is run for a command that takes minutes: `make -n` prints the commands without running them. The job of the
demo runs on few states in test_demo.py, and `make test` is what runs this file."""


BLOCKS = [block for path in READMES for block in blocks(path)]


def name(path):
    return path.relative_to(ROOT).with_suffix("").as_posix()


def test_pictures_of_the_reference_are_none_of_the_blocks(tmp_path, monkeypatch):
    """In a new clone they are not there before the site is built."""
    monkeypatch.setattr(documented_commands, "REFERENCE", tmp_path / "reference")
    page = tmp_path / "page.md"
    page.write_text("![Chips](reference/chips.svg) ![Beside](page.md) ![Drawn](solve.png)", "utf-8")
    assert documented_commands.pictures(page) == ["solve.png"]


def of_kind(*kinds):
    chosen = [block for block in BLOCKS if block.kind in kinds]
    return pytest.mark.parametrize("block", chosen, ids=lambda block: f"{name(block.path)}-{block.number}")


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
        if block.file:
            (folder / block.file).write_text(block.text, encoding="utf-8")


@of_kind("console", "sh")
def test_command_prints_what_is_shown(block, tmp_path, monkeypatch):
    files_of(block.path, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for command, output in block.commands:
        program, *tokens = shlex.split(INSTEAD.get(command, command))
        if program == "make":
            assert shutil.which("make"), "the set-up needs make"
            done = subprocess.run(["make", *tokens], cwd=ROOT, capture_output=True, text=True, check=True)
            assert re.search(r"\bmagtip demo --out out/demo|\bpytest\b", done.stdout)
            continue
        assert program == "magtip", command
        documented_commands.compare(output, documented_commands.printed_by(command), command)


NEEDS_GCC = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="the tutorial compiles the decoder: gcc is missing"
)


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.calibrates, NEEDS_GCC] if path == COMPILED else ()) for path in TUTORIALS],
    ids=name,
)
def test_tutorial_prints_what_it_shows(path, tmp_path, monkeypatch):
    """Its commands and snippets follow each other in one folder; `make docs` also runs those that take longer."""
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    documented_commands.run(path, tmp_path, long=False)


@pytest.mark.parametrize("path", TUTORIALS, ids=name)
def test_notebook_has_the_blocks_of_its_tutorial(path):
    """In their order, with all that is shown, and without links to pages that stand beside no notebook."""
    cells = notebooks.notebook(path)["cells"]
    code = [cell["source"] for cell in cells if cell["cell_type"] == "code"]
    text = "\n".join(cell["source"] for cell in cells if cell["cell_type"] == "markdown")
    assert len(code) == 1 + len(blocks(path))
    for source, block in zip(code[1:], blocks(path), strict=True):
        shown = [command for command, _ in block.commands] if block.kind == "console" else [block.text.rstrip()]
        assert re.sub(r"^!|^%%writefile .*\n", "", source, flags=re.M) == "\n".join(shown)
    pictures = {f"attachment:{name}" for cell in cells for name in cell.get("attachments", ())}
    assert set(re.findall(r"\]\((?!http)([^)]+)\)", text)) == pictures | set(documented_commands.pictures(path))
    assert "```" not in text


@of_kind("python")
def test_snippet_prints_what_is_shown(block):
    assert block.output is not None, "show what it prints in a block `text`"
    documented_commands.run_snippet(block, {"__name__": "snippet"})


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


def not_run():
    """Commands within text, and those that take too long."""
    inline = {command for path in READMES + TUTORIALS for command in INLINE.findall(path.read_text("utf-8"))}
    long = [
        block for path in [PICTURES, *TUTORIALS] for block in blocks(path) if block.long and block.kind == "console"
    ]
    return sorted(inline | {command for block in long for command, _ in block.commands})


@pytest.mark.parametrize("command", not_run())
def test_command_that_is_not_run_is_understood(command):
    """Its verb and options are there, its values are of their kinds."""
    program, *tokens = shlex.split(command)
    if program == "python":
        place = ROOT.joinpath(*tokens[1].split("."))
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists()
    elif len(tokens) == 1:
        assert tokens[0] in commands.app
    else:
        assert callable(commands.app.parse_args(tokens, exit_on_error=False, print_error=False)[0])
