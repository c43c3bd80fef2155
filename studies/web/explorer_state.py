"""The state of the explorer: design, load and the parts that the page asks for, and the controls that change it.

It is checked as on the command line.

A request is the JSON object that the page sends:

    {"number": 7, "side": "a", "parts": ["state", "curve"],
     "state": {"design": {"D": 10}, "load": {"depth": 1, "shear": 0.5, "direction": 90, "friction": "stick",
               "plate_tilt": 0}, "magnet": "rigid", "level": "standard",
               "array": {"beam": "2", "beam_loads": "1:0.5,0,0", "pitch": 16, "polarity": "rows"}}}

Fields that are missing have the values of the preset paper, a load of zero, and the friction that `magtip solve`
chooses. Values that cannot be used raise `BadInput` with the sentence that the command line prints.
"""

from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

from geometry.array_design import POLARITIES
from geometry.design import LAWS, OF_ONE_LAYOUT, PRESETS, BadInput, Design, preset
from geometry.loads import Load, Magnet
from studies.inputs import user_input
from studies.inputs.study_input import IN_STATES, LOADS, load_of
from studies.quantities import UNITS
from studies.web.panels import ANSWERED_PANELS

if TYPE_CHECKING:
    from studies.calibration.sensor_fit import Fit
    from studies.parts.requirements import Requirements
    from studies.sensing.array_readings import Grid

Side = Literal["a", "b"]
Level = Literal["quick", "standard"]

SIDES, LEVELS = get_args(Side), get_args(Level)
PARTS = ("state", "curve", "sensor3d", "field_lines", *(panel.name for panel in ANSWERED_PANELS), "commands")
RATES = {"frequency": "Hz", "speed": "mm/s"}
"""Fields of a load that say how fast the plate moves, and their units: frequency of small vibrations about the load,
speed of loading cycles up to it; 0: none. The solved state is at rest."""
ABSENT = ("shear_y", "grip", "imperfection")
"""Fields of `Load` that the page does not have: its shear has a direction, and its tip touches a plate of which the
side is known."""
LOAD_FIELDS = ("direction", *(name for name in IN_STATES if name not in ABSENT), *RATES)
"""Fields of a load: those of `Load`, shear along the direction, degrees, and the rates."""
OPENING_DEPTH = 1.0
"""Depth of the page's first state for a sensor of the paper's size, mm, and of a page whose address has no depth."""
UNPLACED = "Further fields"
"""Group of the controls of fields that `controls.csv` does not place."""
CONTROLS = Path(__file__).with_name("controls.csv")
"""The controls of the page, in their order."""

OF_ARRAY = ("beam", "beam_loads", "pitch", "polarity")
"""What the page says of an array: the beam whose load is that of the state, and the loads of the others."""

Field = dict[str, Any]
"""A control as the page takes it: group, name, label, unit, low, high, slider, step, kind, choices, help, value."""


@dataclass(frozen=True, slots=True)
class BeamLoads:
    """The loads of an array's beams, and where these stand.

    Attributes
    ----------
    beam : number of the one whose load is that of the state.
    loads : depth, shear along x and along y, mm, of others that are not at rest, by their numbers.
    pitch, polarity : in place of those of the design file; None, "": the same.
    """

    beam: int = 1
    loads: Mapping[int, tuple[float, float, float]] = dataclasses.field(default_factory=dict)
    pitch: float | None = None
    polarity: str | tuple[str, ...] = ""

    def grid(self, stated: Grid) -> Grid:
        """Return the array of a design file as the page has changed it."""
        pitch = stated.pitch if self.pitch is None else self.pitch
        return dataclasses.replace(stated, pitch=pitch, polarity=self.polarity or stated.polarity)


@dataclass(frozen=True, slots=True)
class ExplorerState:
    """A sensor, its load and how they are computed.

    Attributes
    ----------
    friction : of the plate as the page says it; None: that of `magtip solve`.
    level : accuracy to which a state is refined.
    frequency, speed : of small vibrations, Hz, and of loading cycles, mm/s; 0: none.
    """

    design: Design
    load: Load
    magnet: Magnet
    level: Level = "standard"
    friction: float | Literal["none", "stick"] | None = None
    frequency: float = 0.0
    speed: float = 0.0
    array: BeamLoads = BeamLoads()

    @property
    def vibrating_load(self) -> Load:
        """The load about which the plate vibrates: it sticks as the page says, also where nothing slides before."""
        if not self.load.depth:
            return self.load
        return dataclasses.replace(self.load, friction="stick" if self.friction is None else self.friction)


@dataclass(frozen=True, slots=True)
class Request:
    """One request of the page: its number, the side of the comparison, the state, and the parts to compute.

    `needed`, `made` and `stated` are the requirements, the calibrated sensor and the array with which the explorer
    was started.
    """

    number: int
    side: Side
    state: ExplorerState
    parts: tuple[str, ...]
    needed: Requirements | None = None
    made: Fit | None = None
    stated: Grid | None = None

    @property
    def sensor(self) -> Fit | None:
        """The calibrated sensor where the state is that of its design; else None."""
        from studies.calibration import calibration_file

        made, state = self.made, self.state
        if made is None or state.magnet != "rigid" or not calibration_file.describes(made, state.design):
            return None
        return made


def request_of(message: object) -> Request:
    """Return the request in a message of the page, checked as on the command line.

    >>> request_of({"number": 1, "state": {"design": {"D": 10}, "load": {"depth": 1}}}).state.design.D
    10.0
    """
    if not isinstance(message, dict):
        raise BadInput(f"a request must be a table of values; got {message!r:.60}")
    number, side = message.get("number", 0), message.get("side", "a")
    if isinstance(number, bool) or not isinstance(number, int):
        raise BadInput(f"number must be a whole number; got {number!r:.60}")
    if side not in SIDES:
        raise BadInput(f"side must be one of {', '.join(SIDES)}; got {side!r:.60}")
    parts = message.get("parts", ["state"])
    if not isinstance(parts, list) or not all(part in PARTS for part in parts):
        raise BadInput(f"parts must be a list of {', '.join(PARTS)}; got {parts!r:.60}")
    state = state_of(_table("state", message.get("state", {})))
    return Request(number, cast(Side, side), state, tuple(parts))


def state_of(content: Mapping[str, Any]) -> ExplorerState:
    """Return the state in a request, checked as `magtip solve` checks it."""
    from fem.scene import Scene

    magnet = cast(Magnet, content.get("magnet") or "rigid")
    if magnet not in get_args(Magnet):
        raise BadInput(f"magnet must be one of {', '.join(get_args(Magnet))}; got {magnet!r:.60}")
    level = cast(Level, content.get("level") or "standard")
    if level not in LEVELS:
        raise BadInput(f"level must be one of {', '.join(LEVELS)}; got {level!r:.60}")
    values = _table("design", content.get("design") or {})
    user_input.check_keys("design", values, user_input.FIELDS)
    # a text in a field of numbers is read like --set, which refuses it in the same words
    texts = [f"{name}={value}" for name, value in values.items() if isinstance(value, str)]
    numbers = {name: value for name, value in values.items() if not isinstance(value, str)}
    design = user_input.design_from("paper", {**numbers, **user_input.overrides(texts)}, magnet)
    values = _table("load", content.get("load") or {})
    load, rates = page_load(values), {name: _number(name, values.get(name)) for name in RATES}
    for (name, unit), rate in zip(RATES.items(), rates.values(), strict=True):
        if not 0 <= rate < math.inf:
            raise BadInput(f"{name} must be 0 {unit} or more; got {rate:g} {unit}")
    friction = None if values.get("friction") in (None, "") else load.friction
    if load.friction == "stick" and not load.shear:
        # nothing slides before a shear: such a press is that of a plate without friction, and is kept as that
        load = dataclasses.replace(load, friction="none")
    Scene(design, (load,), magnet=magnet)
    array = array_of(_table("array", content.get("array") or {}))
    return ExplorerState(design, load, magnet, level, friction, array=array, **rates)


def array_of(values: Mapping[str, Any]) -> BeamLoads:
    """Return the loads of the beams of a request.

    >>> array_of({"beam": "2", "beam_loads": "1:0.5 3:1,0.2,90"}).loads
    {1: (0.5, 0.0, 0.0), 3: (1.0, 0.0, 0.2)}
    """
    user_input.check_keys("array", values, OF_ARRAY)
    loads = dict[int, tuple[float, float, float]]()
    for text in str(values.get("beam_loads") or "").split():
        number, colon, numbers = text.partition(":")
        parts = [_number(f"the load of beam {number}", part) for part in numbers.split(",")]
        if not (colon and number.isdecimal() and 1 <= len(parts) <= 3 and all(map(math.isfinite, parts))):
            raise BadInput(
                "other loads are BEAM:DEPTH,SHEAR,DIRECTION in mm and degrees, apart by spaces, such as "
                f"2:1 3:0.5,0.2,90; got {text!r:.60}"
            )
        if not parts[0] >= 0:
            raise BadInput(f"the depth of beam {number} must be 0 mm or more; got {parts[0]:g} mm")
        loads[int(number)] = parts[0], *components(*[*parts[1:], 0.0, 0.0][:2])
    beam = _number("beam", values.get("beam") or 1)
    if not (beam >= 1 and beam % 1 == 0):
        raise BadInput(f"beam must be a whole number of 1 or more; got {beam:g}")
    pitch, words = values.get("pitch"), str(values.get("polarity") or "")
    return BeamLoads(
        beam=int(beam),
        loads=loads,
        pitch=None if pitch in (None, "") else _number("pitch", pitch),
        polarity=words if words in ("", *POLARITIES) else tuple(words.split(",")),
    )


def page_load(values: Mapping[str, Any]) -> Load:
    """Return the load of a request.

    >>> page_load({"depth": 1, "shear": 2, "direction": 90}).shear_y
    2.0
    """
    user_input.check_keys("load", values, LOAD_FIELDS)
    words = {name for name, spec in LOADS.items() if spec.metadata["names"]}
    given: dict[str, Any] = {
        name: each if name in words and isinstance(each, str) else _number(name, each)
        for name, each in values.items()
        if name not in RATES and each not in (None, "")
    }
    x, y = components(given.pop("shear", 0.0), given.pop("direction", 0.0))
    return load_of({**given, "shear": x, "shear_y": y})


def components(shear: float, direction: float) -> tuple[float, float]:
    """Return a shear along x and y, mm, from its length and its direction, degrees; exactly 0 along an axis.

    >>> components(2.0, 180.0), components(-1.0, 90.0)
    ((-2.0, 0.0), (0.0, -1.0))
    """
    quarter = direction / 90
    if quarter == round(quarter):
        c, s = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][round(quarter) % 4]
    else:
        c, s = math.cos(math.radians(direction)), math.sin(math.radians(direction))
    return shear * c + 0.0, shear * s + 0.0


def plain(value: float | str) -> str:
    """Return a number as it is typed, such that it is read back exactly.

    >>> plain(8.0), plain(0.1), plain("yeoh")
    ('8', '0.1', 'yeoh')
    """
    return value if isinstance(value, str) else repr(float(value)).removesuffix(".0")


def wrong_field(message: Mapping[str, Any]) -> str | None:
    """Return the first field of a refused request without which the request is accepted; None if there is none."""
    content = message.get("state")
    if not isinstance(content, Mapping):
        return None
    for group in ("load", "design", "array"):
        values = content.get(group)
        for name in values if isinstance(values, Mapping) else ():
            rest = {key: value for key, value in (values or {}).items() if key != name}
            if _accepts({**content, group: rest}):
                return str(name)
    return None


def _accepts(content: Mapping[str, Any]) -> bool:
    try:
        state_of(content)
    except BadInput:
        return False
    return True


def _table(name: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise BadInput(f"{name} must be a table of values; got {value!r:.60}")
    return value


def _number(name: str, value: object) -> float:
    """Return a number of a load; None is 0."""
    if value is None:
        return 0.0
    try:
        if isinstance(value, bool):
            raise TypeError
        number = float(cast(Any, value))
    except (TypeError, ValueError, OverflowError):
        raise BadInput(f"{name.replace('_', ' ')} must be a finite number; got {value!r:.60}") from None
    if name in ("direction", "plate_tilt") and not math.isfinite(number):
        raise BadInput(f"{name.replace('_', ' ')} must be a finite number of degrees; got {number:g}")
    return number


def explorer_fields(design: Design, needed: Requirements | None = None, stated: Grid | None = None) -> list[Field]:
    """Return the controls of array, load and design, in the order of the page; `value` is that of the design.

    Places, labels, sliders and steps are in `controls.csv`, with units, ranges and help of what is no field of a
    design or load; those of their fields come from `Design` and `Load`. A field without a row stands under its name
    behind those of the load, or in the last group; the ends of its slider are in its metadata, or are those of its
    range. A slider covers the part of a range that designers use, the number field beside it takes the whole range.

    >>> [(one["name"], one["unit"], one["value"]) for one in explorer_fields(Design())][:2]
    [('depth', 'mm', 1.0), ('shear', 'mm', 0.0)]
    """
    specs = {spec.name: spec for spec in dataclasses.fields(Design)}
    room, far = design.L - design.magnet_height, round(design.D / 2, 1)
    # the load's sliders reach half a diameter
    by_design: Field = {
        "depth": {"low": 0.0, "high": room, "slider": [0, far], "value": OPENING_DEPTH},
        "shear": {"low": -2 * design.L, "high": 2 * design.L, "slider": [-far, far]},
    }
    fields, parts = [], part_fields(needed)
    with CONTROLS.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            name = row["name"]
            field: Field = {key: row[key] for key in ("group", "name", "label", "kind", "unit", "help")}
            if row["slider_low"]:
                field["slider"] = [float(row["slider_low"]), float(row["slider_high"])]
            if row["step"]:
                field["step"] = float(row["step"])
            if row["choices"]:
                field["choices"] = row["choices"].split()
            if name in specs:
                field |= {"scope": "design", "value": getattr(design, name)} | _of_design(specs[name])
            elif row["kind"] == "part":
                sets = parts[name]
                field |= {"scope": "part", "value": "", "choices": ["", *sets], "sets": sets, "needs": _needs(name)}
            elif name == "magnet":
                field |= {"scope": "magnet", "value": row["value"], "needs": {}}
            else:
                low, high = (float(row[key]) if row[key] else None for key in ("low", "high"))
                value = row["value"] if name == "friction" else float(row["value"] or 0)
                field |= {"scope": "load", "value": value, "low": low, "high": high, "needs": {}}
                field |= _of_load(name, row["help"])
            fields.append(field | by_design.get(name, {}))
    placed = {field["name"] for field in fields}
    of_load = [
        _unplaced("Load", name, LOADS[name])
        | {"scope": "load", "value": LOADS[name].default, "needs": {}}
        | _of_load(name)
        for name in LOAD_FIELDS
        if name not in placed
    ]
    of_design = [
        _unplaced(UNPLACED, name, spec) | {"scope": "design", "value": getattr(design, name)} | _of_design(spec)
        for name, spec in specs.items()
        if name not in placed
    ]
    return [*array_fields(stated), *fields, *of_load, *of_design]


def array_fields(stated: Grid | None) -> list[Field]:
    """Return the controls of an array whose pitch is stated; none without one."""
    if stated is None:
        return []

    def one(name: str, label: str, kind: str, value: Any, words: str, **more: Any) -> Field:
        common = {"group": "Array", "scope": "array", "unit": "", "needs": {}}
        return common | {"name": name, "label": label, "kind": kind, "value": value, "help": words} | more

    numbers = [str(k) for k in range(1, len(stated) + 1)]
    texts = {each: each if isinstance(each, str) else ",".join(each) for each in stated.polarities}
    fields = [
        one("beam", "Beam", "choice", "1", "whose load stands below; each keeps its own", choices=numbers),
        one(
            "beam_loads",
            "Other loads",
            "text",
            "",
            "BEAM:DEPTH,SHEAR,DIRECTION in mm and degrees, such as 2:1 3:1,0.2,90",
        ),
        one(
            "polarity",
            "Polarity",
            "choice",
            texts[stated.polarity],
            "which magnets lie the other way up",
            choices=[*texts.values()],
        ),
    ]
    if stated.pitch is not None:
        ends = {"low": 0.0, "high": None, "slider": [round(stated.pitch / 2, 1), round(3 * stated.pitch, 1)]}
        words = "distance of the beams in a row, and of the rows"
        fields.insert(2, one("pitch", "Pitch", "number", stated.pitch, words, step=0.1) | ends | {"unit": "mm"})
    return fields


def _unplaced(group: str, name: str, spec: dataclasses.Field[Any]) -> Field:
    """Return the place of a field without a row: a group, and a slider in hundred steps."""
    known = spec.metadata
    low, high = known.get("slider", (known.get("low", -math.inf), known.get("high", math.inf)))
    kind = "choice" if "choices" in known else "number" if math.isfinite(high - low) else "text"
    field: Field = {"group": group, "name": name, "label": name.replace("_", " ").capitalize(), "kind": kind}
    if kind == "number":
        field |= {"slider": [float(low), float(high)], "step": float(f"{(high - low) / 100:.1g}")}
    return field


def _of_load(name: str, words: str = "") -> Field:
    """Return unit, range and help of a field of `Load`; the page's shear has a direction, and a help of its own."""
    if name not in LOADS:
        return {}
    known = LOADS[name].metadata
    limits = {key: known[key] if math.isfinite(known[key]) else None for key in ("low", "high")}
    return limits | {"unit": "" if known["unit"] == "1" else known["unit"], "help": words or known["text"]}


def _of_design(spec: dataclasses.Field[Any]) -> Field:
    known = spec.metadata
    unit = UNITS[known["unit"]] if "low" in known else ""
    field: Field = {"help": known["text"], "unit": unit, "needs": _needs(spec.name)}
    if "choices" in known:
        field["choices"] = list(known["choices"])
    elif "low" in known:
        field |= {"low": known["low"], "high": known["high"]}
    return field


def _needs(name: str) -> Field:
    """Return the choices with which a field has an effect, by the name of the choice; empty: always."""
    laws = [law for law, fields in LAWS.items() if name in fields]
    layouts = [layout for layout, fields in OF_ONE_LAYOUT.items() if name in fields]
    needs: Field = {"law": laws} if laws else {}
    if layouts:
        needs["hall_layout"] = layouts
    if name in ("loss_factor", "loss_low", "loss_high"):
        needs["prony"] = [""]
    return needs


def part_fields(needed: Requirements | None) -> dict[str, dict[str, Field]]:
    """Return presets, and parts in use (else all shipped), by control and name, as the fields that each sets."""
    from studies.parts.catalogues import catalogues_of
    from studies.parts.requirements import Requirements

    needed = needed or Requirements(force_z=1.0)
    found = catalogues_of(needed)
    parts: dict[str, dict[str, Field]] = {
        "silicone_part": {part.name: part.fields() | part.loss_field() for part in found.silicones},
        "magnet_part": {part.name: part.fields() for part in found.magnets},
        "grade": {part.grade: {"remanence": part.remanence} for part in sorted(found.magnets, key=lambda m: m.grade)},
        "hall_part": {
            part.name: part.fields() | part.noise_fields(needed.bandwidth, part.average(needed))
            for part in found.hall_parts
        },
    }
    presets = {"preset": {name: dataclasses.asdict(preset(name)) for name in PRESETS}}
    return presets | {
        name: {
            one: {k: v if isinstance(v, str) else round(v, 9) for k, v in sets.items()} for one, sets in of.items()
        }
        for name, of in parts.items()
    }
