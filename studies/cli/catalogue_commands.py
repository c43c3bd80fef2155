"""The verb that lists the parts from which sensors are sized, and published sensors to compare with: catalogue."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from geometry.design import BadInput
from studies.cli.parameters import AsJson, Wide
from studies.output.records import FlatRow
from studies.output.result import Block, Destination, Result, Table, show

Kind = Annotated[
    Literal["magnets", "hall_parts", "silicones", "published"] | None,
    Parameter(
        name="KIND", help="magnets, hall_parts or silicones, or published (sensors); default: the first three."
    ),
]


def catalogue(
    kind: Kind = None,
    /,
    *,
    file: list[Path] | None = None,
    sized: Path | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """List the magnets, Hall parts and silicones from which sensors are sized, or the figures of published sensors.

    Parameters
    ----------
    file
        TOML file with parts of your own, which are added to the shipped ones or replace those of the same name;
        repeatable.
    sized
        Folder with results of magtip size for the boxes of published sensors, each in a folder that is named as its
        file of requirements: what the best variant reaches stands beside the published figures.
    """
    here = Destination(as_json=as_json, wide=wide)
    if kind == "published":
        return show(_published(sized), here)
    if sized is not None:
        raise BadInput("--sized goes with published sensors: magtip catalogue published --sized FOLDER")
    from studies.sizing import catalogues
    from studies.sizing.requirements import CATALOGUES, Requirements

    # the parts do not depend on what a sensor must reach
    parts = catalogues.catalogues_of(Requirements(force_z=1.0, catalogues=tuple(map(str, file or []))))
    records: list[FlatRow] = []
    shown: list[Block] = []
    for each in CATALOGUES if kind is None else (kind,):
        rows = catalogues.rows(getattr(parts, each))
        records += [{"kind": each, **row} for row in rows]
        title = f"{each.replace('_', ' ').capitalize()}: {len(rows)}"
        shown.append(Table(title=title, rows=rows, brief=("source",), first=FIRST[each]))
    shown.append("--wide shows the sources; `assumed` names values without a source that was read.")
    return show(Result(title="Catalogue", records=records, shown=shown), here)


def _published(sized: Path | None) -> Result:
    """Return the figures of published sensors, beside what variants of the same boxes reach."""
    from studies.sizing import published_sensors

    rows = published_sensors.comparison({} if sized is None else published_sensors.reached_in(sized))
    first = ("sensor", "quantity", "unit", "published", "variant")
    table = Table(title="Published sensors", rows=rows, first=first)
    return Result(title=table.title, records=rows, shown=[table, *published_sensors.remarks()])


FIRST = {
    "magnets": ("name", "diameter_mm", "height_mm", "remanence_low_T", "remanence_high_T", "largest_temperature_C"),
    "hall_parts": ("name", "layout", "gain_V_per_mT", "low", "high"),
    "silicones": ("name", "E_low_MPa", "E_MPa", "E_high_MPa", "mixed"),
}
"""Columns that a table must show, by the kind of parts."""
