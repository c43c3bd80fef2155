"""Published sensors beside variants that are sized for the same box of size and force range.

The figures, where each was read, and what is not comparable are in published_sensors.toml. A variant's resolution
is the standard deviation that the noise of the readings causes at the worst pose of the range. It is a lower bound
of the error of a made sensor, which has hysteresis, creep and the error of its calibration too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from geometry.design import BadInput
from studies.inputs.units import quantity
from studies.inputs.user_input import toml_table
from studies.output.bounded_files import json_object

DATA = Path(__file__).with_name("published_sensors.toml")
FOLDER = Path(__file__).resolve().parent.parent / "examples" / "sizing"
"""Folder of the files of requirements that are made from the boxes."""
QUANTITIES = {
    "range_z": ("N", "fem_range_z_N", 1.0),
    "range_x": ("N", "fem_range_x_N", 1.0),
    "resolution_z": ("N", "fem_resolution_z_mN", 1e-3),
    "resolution_x": ("N", "fem_resolution_x_mN", 1e-3),
    "outer_size": ("mm", "outer_size_mm", 1.0),
    "height": ("mm", "height_mm", 1.0),
}
"""Quantities that are compared: unit, column of the front in sizing.json, and the factor to this unit."""
ORIGINS = ("abstract", "paper", "recording", "derived", "assumed")
"""Where a figure was read; "derived" follows from figures that were read."""


def published_sensors() -> list[dict[str, Any]]:
    """Return the published sensors, as their tables state them: the figures in the unit of `QUANTITIES`, and the path
    of the file of requirements with the same box.

    >>> [sensor["name"] for sensor in published_sensors()][:2]
    ['Chathuranga 2016', 'MagOne']
    """
    sensors = toml_table(str(DATA), "file")["sensor"]
    for sensor in sensors:
        sensor["requirements"] = FOLDER / sensor["requirements"]
        for figure in sensor["figures"]:
            name = figure["quantity"]
            if name not in QUANTITIES or figure["origin"] not in ORIGINS:
                raise BadInput(f"{DATA.name}: {sensor['name']}: {name} or {figure['origin']} is unknown")
            figure["value"] = quantity(f"{sensor['name']}: {name}", figure["value"], QUANTITIES[name][0])
    return list(sensors)


def comparison(reached: Mapping[str, Mapping[str, float]]) -> list[dict[str, Any]]:
    """Return a row for each published figure, beside what the sized variant reaches, if one meets the sensor's box.

    reached : by the name of a sensor, the values of its variant by quantity, in the units of `QUANTITIES`.
    """
    rows = []
    for sensor in published_sensors():
        variant = reached.get(sensor["name"], {})
        for figure in sensor["figures"]:
            name, value = figure["quantity"], variant.get(figure["quantity"], math.nan)
            row = {
                "sensor": sensor["name"],
                "quantity": name,
                "unit": QUANTITIES[name][0],
                "published": figure["value"],
            }
            row |= {"statistic": figure["statistic"], "origin": figure["origin"]}
            rows.append(row | {"variant": value if math.isfinite(value) else None})
    return rows


def reached_in(folder: Path) -> dict[str, dict[str, float]]:
    """Return what the best variant of each box reaches, by the name of the published sensor.

    folder : with a folder for each file of requirements, of the same name, into which `magtip size` wrote.
    """
    reached = {}
    for sensor in published_sensors():
        file = folder / sensor["requirements"].stem / "sizing.json"
        if not file.exists():
            continue
        try:
            front = json_object(file)["front"]
            best = next((row for row in front if row["status"] == "ok"), None)
            if best is not None:
                values = {name: (best[column], factor) for name, (_, column, factor) in QUANTITIES.items()}
                reached[sensor["name"]] = {n: v * f for n, (v, f) in values.items() if v is not None}
        except (ValueError, KeyError, TypeError) as error:
            raise BadInput(f"{file} is no result of magtip size ({error!r}): run it again") from None
    if not reached:
        stems = ", ".join(sensor["requirements"].stem for sensor in published_sensors())
        raise BadInput(f"{str(folder)!r} holds no result of magtip size in a folder named {stems}")
    return reached


def remarks() -> list[str]:
    """Return one sentence for each published sensor: what it is, and what is not comparable."""
    return [
        "{name} ({source}) is {body}, read by {read_out}: ".format(**sensor) + "; ".join(sensor["differs"]) + "."
        for sensor in published_sensors()
    ]
