"""Output of several verbs: a record with its warnings, remarks on rows, and failures with their exit status."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from geometry.design import Design
from studies.output import console
from studies.output.result import FAILED, GOOD


def print_record(record: Mapping[str, Any], title: str, left_out: Sequence[str], *, as_json: bool) -> None:
    """Print a record, and its warnings on standard error; a table does not show the keys `left_out`."""
    brief = {key: value for key, value in record.items() if key not in ("warnings", *left_out)}
    console.report([record if as_json else brief], as_json=as_json, title=title)
    for warning in record["warnings"]:
        console.warn(warning)


def print_remarks(
    rows: Sequence[Mapping[str, Any]], keys: Iterable[str], among: Sequence[Mapping[str, Any]] = ()
) -> None:
    """Print each message of the rows once, with the rows to which it belongs (see `console.remarks`)."""
    for remark in console.remarks(rows, keys, among):
        console.note(remark)


def say_if_without_magnet(design: Design) -> None:
    """Print a sentence if the design has no magnet, because `--magnet rigid` then has no effect."""
    if not design.shape.has_magnet:
        console.say("magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone")


def report_failures(records: Sequence[Mapping[str, Any]]) -> int:
    """Return exit status 0 if every record is ok; else print the message of the last failure and return 3."""
    failed = [record for record in records if record.get("status", "ok") != "ok"]
    if failed:
        console.say(f"magtip: {failed[-1].get('message') or 'the solve failed: ' + failed[-1]['status']}")
    return FAILED if failed else GOOD
