"""The record of the run that filled a folder: command, versions and design, for programs and `magtip report`.

Pages of results say the same in a sentence (`studies.output.provenance.made`); a folder of tables has only this file.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from studies.output import atomic_files
from studies.output.provenance import OWN, installed, made, versions

NAME = "run.json"
"""Name of the file in a folder."""
FORMAT = 1
"""Version of the file; a folder with a newer one is refused."""


class Newer(BadInput):
    """A file of a newer format than this version reads."""


@dataclass(frozen=True, slots=True)
class Run:
    """What made a folder.

    Attributes
    ----------
    command : command line; empty if a Python function was called.
    made : the sentence with command, versions and commit.
    design : fields of the design; empty if there is no single one.
    """

    command: str
    made: str
    design: Mapping[str, Any]


def write(folder: Path, command: str, design: Mapping[str, Any], origin: str = "") -> None:
    """Write the record of a run into its folder.

    Parameters
    ----------
    command : command line from `studies.cli.parameters.command`.
    design : fields of the design that was studied.
    origin : text from `provenance.versions`; default: the present one.
    """
    sentence = made(command, origin or versions())
    record = {"format": FORMAT, "command": command, "made": sentence, "design": dict(design)}
    atomic_files.write_json(folder / NAME, record)


def read(file: Path) -> Run:
    """Read a record.

    Raises
    ------
    Newer
        The file has a newer format.
    BadInput
        It is no record of a run.
    """
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(record, dict):
            raise TypeError
        check_format(file, record)
        run = Run(str(record["command"]), str(record["made"]), dict(record["design"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        if isinstance(error, Newer):
            raise
        raise BadInput(f"{file.name} is no record of a run of magtip") from None
    return run


def check_format(file: Path, record: Mapping[str, Any]) -> None:
    """Refuse a JSON object whose `format`, or `version`, is newer than this version reads.

    Raises
    ------
    Newer
        It is a number above `FORMAT`.
    """
    number = record.get("format", record.get("version", FORMAT))
    if isinstance(number, (int, float)) and number > FORMAT:
        raise Newer(
            f"{str(file)!r} has format {number:g}, and magtip {installed(OWN) or ''} reads formats up to {FORMAT}: "
            "use the version of magtip that wrote it, or a newer one"
        )
