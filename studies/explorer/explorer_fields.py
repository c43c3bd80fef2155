"""The controls of the explorer's page: names, ranges, units and help of the fields of a design and of a load.

Units and ranges come from the metadata of `Design` and from the bounds of `Load`. A slider covers the part of a range
that designers use; the number field beside it takes the whole range.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from geometry.design import LAWS, OF_MAGNET, OF_ONE_LAYOUT, OF_TIME, Design
from geometry.loads import STEEPEST
from studies.explorer.state_commands import OPENING_DEPTH

Field = dict[str, Any]
"""A control as the page takes it: group, name, label, unit, low, high, slider, step, kind, choices, help, value."""

STEEPEST_DEGREES = math.floor(math.degrees(STEEPEST))
"""Largest tilt of the plate in whole degrees."""

GROUPS: dict[str, tuple[str, ...]] = {
    "Beam": ("D", "L", "E", "nu"),
    "Law": ("law", "mooney_share", "yeoh_2", "yeoh_3", "ogden_alpha1", "ogden_alpha2", "ogden_share"),
    "Magnet": ("magnet_diameter", "magnet_height", "l0", "remanence", "magnet_north", "magnet_edge_radius"),
    "Hall elements": (
        *("hall_layout", "f", "c", "chip_x", "hall_gain", "hall_null", "hall_low", "hall_high", "hall_noise"),
        *("hall_noise_density", "hall_bandwidth", "hall_noise_floor", "hall_average", "hall_step", "hall_plate"),
    ),
    "Densities": ("density", "magnet_density"),
    "Relaxation": OF_TIME,
}
"""The fields of a design in the order of the page."""

LABELS = {
    "D": "Diameter D",
    "L": "Length L",
    "f": "S2 and S3 at f",
    "E": "Modulus E",
    "nu": "Poisson's ratio",
    "c": "S2, S3 up by c",
    "l0": "Height over S1, l0",
    "law": "Law",
    "mooney_share": "Share of C01",
    "yeoh_2": "C20 / C10",
    "yeoh_3": "C30 / C10",
    "ogden_alpha1": "First exponent",
    "ogden_alpha2": "Second exponent",
    "ogden_share": "Share of mu_2",
    "magnet_diameter": "Diameter",
    "magnet_height": "Height",
    "magnet_north": "North pole",
    "magnet_edge_radius": "Edge radius",
    "hall_layout": "Layout",
    "chip_x": "Chip at x",
    "density": "Silicone",
    "magnet_density": "Magnet",
    "loss_factor": "Loss factor",
    "loss_low": "Loss factor from",
    "loss_high": "Loss factor to",
    "prony": "Prony branches",
    "modulus": "E is the modulus",
}
"""Labels that differ from the field's name."""

SLIDERS: dict[str, tuple[float, float, float]] = {
    "D": (4, 20, 0.1),
    "L": (3, 40, 0.1),
    "f": (2, 15, 0.1),
    "E": (0.05, 5, 0.01),
    "nu": (0.4, 0.4999, 0.0001),
    "mooney_share": (0, 1, 0.01),
    "yeoh_2": (-0.3, 0.5, 0.005),
    "yeoh_3": (-0.05, 0.1, 0.001),
    "ogden_alpha1": (0.5, 12, 0.1),
    "ogden_alpha2": (-12, -0.5, 0.1),
    "ogden_share": (0, 1, 0.01),
    "magnet_diameter": (0, 10, 0.1),
    "magnet_height": (0, 8, 0.1),
    "magnet_edge_radius": (0, 0.5, 0.01),
    "remanence": (0.8, 1.5, 0.01),
    "l0": (2, 20, 0.1),
    "c": (-2, 6, 0.1),
    "chip_x": (-10, 10, 0.1),
    "hall_gain": (5, 100, 0.05),
    "hall_null": (0.5, 4.5, 0.05),
    "hall_low": (0, 1, 0.05),
    "hall_high": (1, 5, 0.05),
    "hall_noise": (0, 0.01, 0.0001),
    "hall_noise_density": (0, 1e-4, 1e-6),
    "hall_bandwidth": (10, 1e5, 10),
    "hall_noise_floor": (0, 0.01, 0.0001),
    "hall_average": (1, 256, 1),
    "hall_step": (0, 0.01, 0.0001),
    "hall_plate": (0, 1, 0.01),
    "density": (900, 1500, 10),
    "magnet_density": (7000, 8000, 10),
    "loss_factor": (0, 0.5, 0.01),
    "loss_low": (1e-3, 1, 0.001),
    "loss_high": (10, 1e4, 10),
}
"""Least and largest value and step of the sliders, in the unit of the field."""

LOGARITHMIC = ("E", "hall_bandwidth", "loss_low", "loss_high")
"""Fields whose slider moves by equal ratios."""


def explorer_fields(design: Design) -> list[Field]:
    """Return the controls of load and design, in the order of the page; `value` is that of the design.

    >>> [(one["name"], one["unit"], one["value"]) for one in explorer_fields(Design())][:2]
    [('depth', 'mm', 1.0), ('shear', 'mm', 0.0)]
    """
    specs = {spec.name: spec for spec in dataclasses.fields(Design)}
    fields = _load_fields(design)
    for group, names in GROUPS.items():
        if group == "Magnet":
            fields.append(_MAGNET | {"group": group})
        fields += [_design_field(group, specs[name], getattr(design, name)) for name in names]
    return fields


def _design_field(group: str, spec: dataclasses.Field[Any], value: float | str) -> Field:
    """Return the control of one field of a design."""
    label = LABELS.get(spec.name) or spec.name.removeprefix("hall_").replace("_", " ").capitalize()
    common = {"group": group, "scope": "design", "name": spec.name, "label": label, "help": spec.metadata["text"]}
    common |= {"value": value, "needs": _needs(spec.name)}
    if "choices" in spec.metadata:
        return common | {"kind": "choice", "choices": list(spec.metadata["choices"]), "unit": ""}
    if "low" not in spec.metadata:
        return common | {"kind": "text", "unit": ""}
    low, high, step = SLIDERS[spec.name]
    unit = "" if spec.metadata["unit"] == "1" else spec.metadata["unit"]
    kind = "logarithmic" if spec.name in LOGARITHMIC else "number"
    field = common | {"kind": kind, "unit": unit, "low": spec.metadata["low"], "high": spec.metadata["high"]}
    field |= {"slider": [low, high], "step": step}
    return field | {"presets": _grades()} if spec.name == "remanence" else field


def _needs(name: str) -> Field:
    """Return the choices with which a field has an effect, by the name of the choice; empty: always."""
    laws = [law for law, fields in LAWS.items() if name in fields]
    layouts = [layout for layout, fields in OF_ONE_LAYOUT.items() if name in fields]
    needs: Field = {"law": laws} if laws else {}
    if layouts:
        needs["hall_layout"] = layouts
    if name in ("loss_factor", "loss_low", "loss_high"):
        needs["prony"] = [""]
    if name in OF_MAGNET or name == "magnet_edge_radius":
        needs["magnet_diameter"] = "positive"
    return needs


def _grades() -> list[Field]:
    """Return the grades of magnets in the catalogue, each with the middle of the range of its remanence, T."""
    from studies import sizing
    from studies.sizing.catalogue_files import read_catalogue

    file = Path(str(sizing.__file__)).with_name("magnets.toml")
    grades = read_catalogue(str(file)).grades
    return [{"name": name, "value": round(sum(grade["remanence"]) / 2, 4)} for name, grade in grades.items()]


def _load_fields(design: Design) -> list[Field]:
    """Return the controls of the load; the sliders reach half a diameter."""
    far = round(design.D / 2, 1)

    def number(name: str, label: str, unit: str, low: float | None, high: float | None, **more: Any) -> Field:
        common = {"group": "Load", "scope": "load", "kind": "number", "needs": {}}
        return common | {"name": name, "label": label, "unit": unit, "low": low, "high": high} | more

    room = design.L - design.magnet_height
    return [
        number(
            "depth",
            "Depth",
            "mm",
            0.0,
            room,
            slider=[0, far],
            step=0.01,
            value=OPENING_DEPTH,
            help="travel of the plate",
        ),
        number(
            *("shear", "Shear", "mm", -2 * design.L, 2 * design.L),
            slider=[-far, far],
            step=0.01,
            value=0.0,
            help="sideways travel of the plate",
        ),
        number(
            *("direction", "Direction", "deg", -180.0, 180.0),
            slider=[-180, 180],
            step=1,
            value=0.0,
            help="direction of the shear, from x towards y",
        ),
        number(
            *("friction", "Friction", "", 0.0, None),
            kind="friction",
            choices=["none", "stick", "coefficient"],
            slider=[0, 1.5],
            step=0.01,
            value="stick",
            help="none, stick (the contact area is bonded during the shear) or coefficient",
        ),
        number(
            *("plate_tilt", "Plate tilt", "deg", -STEEPEST_DEGREES, STEEPEST_DEGREES),
            slider=[-20, 20],
            step=0.5,
            value=0.0,
            help="turns the normal from z towards x",
        ),
        number(
            *("frequency", "Frequency", "Hz", 0.0, 1e6),
            slider=[0, 1000],
            step=1,
            value=0.0,
            help="of small vibrations about this state; 0: none",
        ),
        number(
            *("speed", "Speed", "mm/s", 0.0, 1e6),
            slider=[0, 20],
            step=0.1,
            value=0.0,
            help="of the plate in loading cycles; 0: static",
        ),
    ]


_MAGNET: Field = {
    "scope": "magnet",
    "kind": "choice",
    "name": "magnet",
    "label": "Mechanics",
    "unit": "",
    "choices": ["rigid", "ignored"],
    "needs": {},
    "help": "rigid body, or ignored: the whole beam is silicone",
    "value": "rigid",
}
"""The control of the magnet's mechanics."""
