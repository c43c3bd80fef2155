"""What several verbs print: a record with its warnings, remarks on rows, what is ignored, and what failed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from geometry.design import Design
from studies.inputs.exit_status import FAILED, GOOD
from studies.output import console


def print_record(record: Mapping[str, Any], title: str, left_out: Sequence[str], *, as_json: bool) -> None:
    """Print a record, its warnings on standard error; a table is without the keys to leave out."""
    brief = {key: value for key, value in record.items() if key not in ("warnings", *left_out)}
    console.report([record if as_json else brief], as_json=as_json, title=title)
    for warning in record["warnings"]:
        console.warn(warning)


def print_remarks(
    rows: Sequence[Mapping[str, Any]], keys: Iterable[str], among: Sequence[Mapping[str, Any]] = ()
) -> None:
    """Print each message of the rows once, with the rows that it belongs to (see `console.remarks`)."""
    for remark in console.remarks(rows, keys, among):
        console.note(remark)


def say_what_is_ignored(design: Design) -> None:
    """A sentence where the magnet is asked for and the design has none."""
    if not design.shape.has_magnet:
        console.say("magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone")


def judged(records: Sequence[Mapping[str, Any]]) -> int:
    """0 if every record is good, else 3 and a sentence."""
    failed = [record for record in records if record.get("status", "ok") != "ok"]
    if failed:
        console.say(f"magtip: {failed[-1].get('message') or 'the solve failed: ' + failed[-1]['status']}")
    return FAILED if failed else GOOD
