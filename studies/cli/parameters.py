"""Parameters that several verbs take, and the status that their records give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter

from geometry.design import Design
from geometry.loads import Magnet
from studies.inputs import input_warnings, user_input
from studies.inputs.exit_status import FAILED, GOOD
from studies.output import console

Source = Annotated[str, Parameter(name="DESIGN", help="A preset's name (paper) or a TOML file.")]
Sets = Annotated[list[str] | None, Parameter(name="--set", help="Override a field, KEY=VALUE; repeatable.")]
AsJson = Annotated[bool, Parameter(name="--json", help="Print JSON, one object per line, and nothing else.")]
Wide = Annotated[
    bool,
    Parameter(
        name="--wide", help="All columns of a table, however long its lines; default: the main ones, as many as fit."
    ),
]


def design_of(source: str, sets: Sequence[str] | None, magnet: Magnet = "rigid") -> Design:
    """The design of `inputs.read_design`; what of it has no effect, or is no silicone's, is said."""
    found = user_input.read_design(source, sets or [], magnet=magnet)
    input_warnings.say_what_is_idle(found)
    return found


def judged(records: Sequence[dict[str, Any]]) -> int:
    """0 if every record is good, else 3 and a sentence."""
    failed = [record for record in records if record.get("status", "ok") != "ok"]
    if failed:
        console.say(f"magtip: {failed[-1].get('message') or 'the solve failed: ' + failed[-1]['status']}")
    return FAILED if failed else GOOD
