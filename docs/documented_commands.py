"""Commands and Python snippets of the documents: read from their fences, run, compared with what stands below them.

A block `console` holds commands after `$`, each with its output; a block `text` is the output of the block `python`
before it; a block `toml` whose first line is a comment with a name is that file, and so is a block `c`. A block
`console long` takes more than some seconds: only `make docs` runs it. Numbers are compared to the digits that are
printed, spaces are not, and a line `...` stands for any lines.

Own code, because none of the packages for this knows all three forms: pytest-codeblocks compares no numbers and runs
shells, Sybil wants parsers for each form that are as long as this file, and each is one more dependency.

`python docs/documented_commands.py FOLDER` runs the tutorials and the page of pictures, each in a folder of its own
there, in which the site finds what they have drawn.
"""

import contextlib
import functools
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("[!i]*.md"))
PICTURES = ROOT / "docs" / "pictures.md"
"""A command and its result for each verb; they follow each other in one folder, as those of a tutorial do."""
REFERENCE = ROOT / "docs" / "reference"
"""Pages and drawings that are made when the site is built: none of them is in a new clone."""
FENCE = re.compile(r"^( *)```(\w+)( long)?\n(.*?)^\1```$", flags=re.M | re.S)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
FILE = re.compile(r"(?:# (\S+\.toml)|/\* (\S+\.c):)")


@dataclass(frozen=True)
class Block:
    path: Path
    number: int
    kind: str
    text: str
    output: str | None = None
    long: bool = False

    @property
    def file(self) -> str | None:
        """The file that a block is, named in its first line."""
        first = FILE.match(self.text)
        return (first[1] or first[2]) if first and self.kind in ("toml", "c") else None

    @property
    def commands(self) -> list[tuple[str, str | None]]:
        """Each command after $, with its output; in a block `sh` all lines are commands, without output."""
        if self.kind == "sh":
            return [(line.partition("#")[0].strip(), None) for line in self.text.splitlines()]
        parts = re.split(r"^\$ ", self.text, flags=re.M)
        assert not parts[0], "a block console begins with $"
        return [part.partition("\n")[::2] for part in parts[1:]]


def blocks(path: Path) -> list[Block]:
    """Return the fenced blocks of a document; the output of a snippet belongs to it."""
    parts: list[Block] = []
    for number, (indent, kind, long, text) in enumerate(FENCE.findall(path.read_text("utf-8"))):
        text = "".join(line.removeprefix(indent) for line in text.splitlines(keepends=True))
        if kind == "text" and parts and parts[-1].kind == "python":
            parts[-1] = Block(path, parts[-1].number, "python", parts[-1].text, text, parts[-1].long)
        else:
            parts.append(Block(path, number, kind, text, long=bool(long)))
    return parts


def close(shown: str, printed: str) -> bool:
    """Return whether a number is the one that is shown, to its last digit."""
    mantissa, _, power = shown.lower().partition("e")
    digit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= 1.001 * digit


def same_line(shown: str, printed: str) -> bool:
    if NUMBER.sub("#", shown).split() != NUMBER.sub("#", printed).split():
        return False
    return all(map(close, NUMBER.findall(shown), NUMBER.findall(printed)))


def same(shown: list[str], printed: list[str]) -> bool:
    """Return whether lines are as they are shown, with `...` for any lines."""
    if not shown:
        return not printed
    if shown[0] == "...":
        return any(same(shown[1:], printed[k:]) for k in range(len(printed) + 1))
    return bool(printed) and same_line(shown[0], printed[0]) and same(shown[1:], printed[1:])


def compare(shown: str | None, printed: str, what: str) -> None:
    """Raise AssertionError with both texts if something else is printed than is shown."""
    lines = [[line for line in (text or "").splitlines() if line.strip()] for text in (shown, printed)]
    assert same(*lines), f"{what}\n--- shown\n{shown}\n--- printed\n{printed}"


def printed_by(command: str) -> str:
    """Run a command where it stands, and return what it prints on standard output."""
    from studies.cli import entry_point

    words, _, given = command.partition(" < ")
    program, *tokens = shlex.split(words)
    if program == "magtip":
        with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as said:
            status = entry_point.main(tokens)
        assert status == 0, f"{command} ends with status {status}\n{said.getvalue()}"
        return out.getvalue()
    program = sys.executable if program == "python" else program
    with open(given or os.devnull, encoding="utf-8") as source:
        return subprocess.run([program, *tokens], stdin=source, capture_output=True, text=True, check=True).stdout


def run_snippet(block: Block, names: dict[str, object]) -> None:
    """Run a snippet with names that it may add to, and compare what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(block.text, str(block.path), "exec"), names)
    compare(block.output, out.getvalue(), f"{block.path.name}, block {block.number}")


def run(path: Path, folder: Path, *, long: bool) -> None:
    """Run the blocks of a document after each other in a folder, with the files and the names that they make.

    Raises
    ------
    AssertionError
        Something else is printed than is shown, or a picture is shown that no block makes.
    """
    names: dict[str, object] = {"__name__": "snippet"}
    left_out = False
    with contextlib.chdir(folder):
        for block in blocks(path):
            if block.file:
                Path(block.file).write_text(block.text, encoding="utf-8")
            elif block.long and not long:
                left_out = True
            elif block.kind == "python":
                run_snippet(block, names)
            else:
                assert block.kind == "console", block.kind
                for command, output in block.commands:
                    compare(output, printed_by(command), command)
    missing = [name for name in pictures(path) if not (folder / name).exists()]
    assert left_out or not missing, f"{path.name} shows what its blocks do not make: {', '.join(missing)}"


def pictures(path: Path) -> list[str]:
    """Return the pictures of a document that its blocks make: those neither beside it nor in the reference."""
    shown = re.findall(r"!\[[^]]*\]\(([^)]+)\)", path.read_text("utf-8"))
    places = {name: (path.parent / name).resolve() for name in shown}
    return [name for name, place in places.items() if not (place.is_relative_to(REFERENCE) or place.exists())]


def _run_all(path: Path, root: Path) -> str | None:
    """Run a document with a store of its own, and return what is not as it is shown."""
    from studies.output.solution_pictures import quiet

    quiet()
    (root / path.stem).mkdir(parents=True)
    os.environ |= {"MAGTIP_STORE": str(root / f"{path.stem}.sqlite"), "COLUMNS": "100", "PYTHONPATH": str(ROOT)}
    try:
        run(path, root / path.stem, long=True)
    except AssertionError as error:
        return f"{path.name}: {error}"
    return None


def main(root: Path) -> int:
    """Run all documents, two at a time, and say what is not as it is shown."""
    shutil.rmtree(root, ignore_errors=True)
    with ProcessPoolExecutor(2) as pool:
        wrong = [text for text in pool.map(functools.partial(_run_all, root=root), [PICTURES, *TUTORIALS]) if text]
    print("\n\n".join(wrong), end="")
    return bool(wrong)


if __name__ == "__main__":
    sys.path[:0] = [str(ROOT)]
    sys.exit(main(Path(sys.argv[1]).resolve()))
