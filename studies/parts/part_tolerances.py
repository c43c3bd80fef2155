"""Tolerances of a made sensor: how far its silicone, magnet, Hall parts and places lie from its design.

A tolerance T is the largest deviation. A "uniform" deviation has equal density from -T to T. A "normal" deviation has
the standard deviation T/2 before it is cut off at -T and T, as if parts outside were sorted out.

A design that names its silicone is made of parts of the catalogues: the silicone of this name, the magnet of its size
and a grade with its remanence, the Hall part with its figures. Their tolerances are the ranges of the catalogue, and
the play of an element in its seat is that of the process that prints the base. `magtip size` knows the parts that it
chose, and writes a table [tolerances] into the design file for those that the shipped catalogues do not have. What no
part says has a usual tolerance (`tolerances.csv`). Spread, yield, calibration and simulated benches take all of them
from here.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.fabrication.printability import PROCESSES
from studies.inputs.table_input import number
from studies.inputs.user_input import check_keys, fabrication_of, pairs, table_beside
from studies.parts.catalogues import HallPartEntry, MagnetEntry, SiliconeEntry, shipped_parts

Tolerances = Mapping[str, float]
"""Largest deviations of a made sensor from its design by name; 0 for a value that does not vary."""
with Path(__file__).with_name("tolerances.csv").open(encoding="utf-8", newline="") as _file:
    SPECS = {row["name"]: row for row in csv.DictReader(_file)}
"""Default, unit, distribution, number of independent deviations (about two axes, or of each element), meaning and
source of each tolerance. `assumed` where no data sheet or measurement gives the default. A tolerance in percent is
relative to the design's value."""
CUT = 2.0
"""Number of standard deviations at which a normal deviation is cut off: 4.6 % of parts are sorted out."""
MOST = {"percent": 90.0, "mm": 100.0, "deg": 45.0}
"""Largest tolerances, by unit, else 1: a deviation of 100 % would allow a value of 0, of which there is no sensor."""


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of the catalogues that a design is made of, and the process that prints its base; None: unknown."""

    silicone: SiliconeEntry | None = None
    magnet: MagnetEntry | None = None
    hall_part: HallPartEntry | None = None
    process: str | None = None


def tolerances(**given: float) -> dict[str, float]:
    """Return all tolerances; those that are not given have their defaults.

    >>> tolerances(E=-1)
    Traceback (most recent call last):
        ...
    geometry.bad_input.BadInput: tolerance E must be a number of percent from 0 to 90; got -1
    """
    for name, value in given.items():
        unit = SPECS[name]["unit"]
        if not 0 <= value <= MOST.get(unit, 1.0):
            what = {"percent": "a number of percent", "1": "a number"}.get(unit, f"a number of {unit}")
            raise BadInput(f"tolerance {name} must be {what} from 0 to {MOST.get(unit, 1.0):g}; got {value:g}")
    return {name: float(spec["default"]) for name, spec in SPECS.items()} | given


def standard_deviation(name: str, tolerance: float) -> float:
    """Return the standard deviation of what deviates within a tolerance, in its unit.

    >>> standard_deviation("E", 10.0)
    5.0
    """
    return tolerance / (math.sqrt(3) if SPECS[name]["shape"] == "uniform" else CUT)


def parts_of(design: Design, process: str | None = None) -> Parts:
    """Return the parts of the shipped catalogues that a design is made of.

    >>> parts = parts_of(Design(silicone="Dragon Skin 30", remanence=1.2, hall_gain=10))
    >>> parts.silicone.name, parts.magnet.name, parts.hall_part
    ('Dragon Skin 30', '4x2 N35', None)
    """
    magnets, hall_parts, silicones = shipped_parts()
    hall_part = next((part for part in hall_parts if part.is_of(design)), None)
    if not design.silicone:
        # a chip is named by its layout
        return Parts(hall_part=None if design.hall_layout == "three" else hall_part, process=process)
    size = (design.magnet_diameter, design.magnet_height)
    sold = [
        magnet
        for magnet in magnets
        if (magnet.diameter, magnet.height) == size
        and magnet.remanence_low <= design.remanence <= magnet.remanence_high
    ]
    # grades overlap: the one in whose middle the remanence lies
    magnet = min(sold, key=lambda each: abs(each.remanence - design.remanence), default=None)
    return Parts(
        next((each for each in silicones if each.name == design.silicone), None),
        magnet,
        hall_part,
        process,
    )


def sources_of(design: Design, parts: Parts | None = None) -> dict[str, tuple[float, str]]:
    """Return the tolerances that parts and process say, each with its source.

    parts : default: those of the shipped catalogues.
    """
    known, found = parts_of(design) if parts is None else parts, dict[str, tuple[float, str]]()
    if (silicone := known.silicone) is not None:
        found["E"] = 100 * _farthest(design.E, silicone.E_low, silicone.E_high) / design.E, silicone.source
        found["nu"] = _farthest(design.nu, silicone.nu_low, silicone.nu_high), silicone.source
    if (magnet := known.magnet) is not None:
        way = 100 * _farthest(design.remanence, magnet.remanence_low, magnet.remanence_high) / design.remanence
        found["remanence"] = way, magnet.source
        found |= dict.fromkeys(("magnet_diameter", "magnet_height"), (magnet.tolerance, magnet.source))
    if (part := known.hall_part) is not None:
        kind = "hall" if part.layout == "three" else "chip"
        for key, value in (("gain", 100 * part.gain_tolerance), ("null", part.null_tolerance)):
            if value is not None:
                assumed = "assumed: " if f"{key}_tolerance" in part.assumed else ""
                found[f"{kind}_{key}"] = value, f"{assumed}{part.source}"
    if known.process is not None:
        play = PROCESSES[known.process].fit / 2, f"gap of a seat that is printed of {PROCESSES[known.process].name}"
        found |= dict.fromkeys(("hall_x", "hall_y"), play)
    return found


def _farthest(value: float, low: float, high: float) -> float:
    return max(high - value, value - low, 0.0)


def tolerances_of(design: Design, parts: Parts | None = None) -> dict[str, float]:
    """Return the tolerances of a design's parts and process; others are usual ones.

    parts : default: those of the shipped catalogues.

    >>> tolerances_of(Design())["E"], tolerances_of(Design(hall_layout="tmag5170a1"))["chip_gain"]
    (10.0, 2.6)
    >>> round(tolerances_of(Design(silicone="Dragon Skin 30", E=0.75))["E"], 6)  # 0.528 to 1.02 MPa
    36.0
    """
    return tolerances(**{name: value for name, (value, _) in sources_of(design, parts).items()})


def batches_of(design: Design, parts: Parts | None = None) -> dict[str, tuple[float, float]]:
    """Return the ranges of E, nu and remanence that batches of a design's parts may have, MPa, 1 and T.

    Those of the catalogue; what no part says has its tolerance about the design's value.
    """
    known, usual = parts_of(design) if parts is None else parts, tolerances_of(design, parts)
    E, J = (getattr(design, name) * usual[name] / 100 for name in ("E", "remanence"))
    found = {
        "E": (design.E - E, design.E + E),
        "nu": (max(design.nu - usual["nu"], 0.0), min(design.nu + usual["nu"], 0.5)),
        "remanence": (design.remanence - J, design.remanence + J),
    }
    if (silicone := known.silicone) is not None:
        found |= {"E": (silicone.E_low, silicone.E_high), "nu": (silicone.nu_low, silicone.nu_high)}
    if (magnet := known.magnet) is not None:
        found["remanence"] = magnet.remanence_low, magnet.remanence_high
    # a value that its user has set beyond what is sold
    return {
        name: (min(low, getattr(design, name)), max(high, getattr(design, name)))
        for name, (low, high) in found.items()
    }


def values_at(design: Design, parts: Parts | None, shares: Array) -> dict[str, Array]:
    """Return E, nu and remanence, MPa, 1 and T, below which lie these shares (n, 3) of what is sold.

    A half lies below the design's value, which is typical, and need not be in the middle of a range.
    """
    return {
        name: np.interp(shares[:, k], [0.0, 0.5, 1.0], [low, getattr(design, name), high])
        for k, (name, (low, high)) in enumerate(batches_of(design, parts).items())
    }


def parse_tolerances(texts: Sequence[str], design: Design = Design(), source: str = "paper") -> dict[str, float]:
    """Return the tolerances of texts NAME=VALUE, else of the table [tolerances] of a design file, else of its parts.

    source : preset or file of the design, whose table [fabrication] names the process.

    >>> parse_tolerances(["E=5"])["E"]
    5.0
    """
    given = pairs("--tolerance", texts, "chip_null=2")
    check_keys("--tolerance", given, SPECS)
    values = {}
    for name, text in given.items():
        value = number(text)
        if value is None or not math.isfinite(value):
            raise BadInput(f"tolerance {name} must be a finite number; got {repr(text) if value is None else text}")
        values[name] = value
    table = table_beside(source, "tolerances", dict.fromkeys(SPECS, float))
    return tolerances(**tolerances_of(design, parts_of_file(design, source)) | table | values)


def parts_of_file(design: Design, source: str) -> Parts:
    """Return the parts of a design whose preset or file, with the process in its table [fabrication], is given."""
    process = fabrication_of(source).get("process")
    if process not in (None, *PROCESSES):
        raise BadInput(f"{source}: there is no process {process!r}: choose one of {', '.join(PROCESSES)}")
    return parts_of(design, process)


def stated(design: Design, parts: Parts) -> dict[str, float]:
    """Return the tolerances of parts that the shipped catalogues do not have, for a design file."""
    known = tolerances_of(design, dataclasses.replace(parts_of(design), process=parts.process))
    return {name: value for name, value in tolerances_of(design, parts).items() if value != known[name]}
