"""Study files in TOML, and the same study from options: the design, the axes and samples, the models and quantities.

Input that cannot be used raises a `BadInput` here, whose message is one sentence with the remedy.

A study file of version 2 has these keys; all but `axes`, `zipped` and `sample` (one of them is needed) are optional.
Files of version 1 have the same keys except `load`, `zipped`, `sample`, `models` and `quantities`.
An axis is a field of `Design`, `magnet` (rigid or ignored), or a field of the load as the options of `magtip solve`
name it; lengths may be given over the diameter, such as "L/D" and "depth/D". Its values are a list,
`lin:START:STOP:COUNT` or `log:START:STOP:COUNT`; in a file also
`{ linspace = [start, stop, count] }` and `{ logspace = [start, stop, count] }`.

    version = 2                          # of this format
    design = "paper"                     # a preset, a file, or a table of fields
    magnet = "rigid"
    models = ["standard", "paper"]       # accuracies of the finite elements, levels of the formulas
    quantities = ["force", "shift"]
    [load]                               # fields of the load that do not vary
    depth = 1.0
    [axes]                               # every combination of their values is a case
    D = [6, 8, 10]
    E = { linspace = [0.5, 2, 4] }
    [[zipped]]                           # axes of equal length that vary together
    L = [9, 12]
    l0 = [7.2, 10.2]
    [sample]                             # points in a box
    method = "sobol"
    count = 64
    [sample.ranges]
    nu = [0.49, 0.4998]
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from geometry.bad_input import nearest
from geometry.design import PRESETS, BadInput, Design
from geometry.loads import Load, Magnet
from studies.inputs import user_input
from studies.inputs.user_input import FIELDS, AccuracyName, Value
from studies.quantities import QUANTITIES, column_name

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_VALUES = 1_000_000
"""Largest number of values of an axis; a larger one is taken for a mistake."""
SPACINGS = {"lin": "linspace", "log": "logspace"}
"""Names of evenly spaced values, on the command line and in a study file."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """What an axis can be: unit, range of numbers, and the names that it accepts besides or instead of numbers.

    `open_low` is True where the lower bound itself is refused. A `text` may be any text, in a table of cases only.
    """

    unit: str
    low: float = -math.inf
    high: float = math.inf
    names: tuple[str, ...] = ()
    is_number: bool = True
    open_low: bool = False
    text: bool = False


@dataclass(frozen=True, slots=True)
class Factor:
    """Axes that vary together: one axis of a grid, a zipped group, or the axes of a sample.

    values : for each axis all its values, one for each point; of a table that is given, arrays.
    sampled : whether the points are a sample of a box.
    """

    names: tuple[str, ...]
    values: tuple[tuple[Value, ...] | NDArray[Any], ...]
    sampled: bool = False

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.values[0])


DESIGN = {
    name: Quantity("1", names=tuple(spec.metadata["choices"]), is_number=False)
    if "choices" in spec.metadata
    else Quantity(spec.metadata["unit"], spec.metadata["low"], spec.metadata["high"])
    for name, spec in FIELDS.items()
    if "choices" in spec.metadata or "low" in spec.metadata
} | {"prony": Quantity("1", is_number=False, text=True)}
"""Fields of a design that can vary: all but the name of the silicone."""
LOADS = {spec.metadata["column"] or spec.name: spec for spec in dataclasses.fields(Load)}
"""Fields of `geometry.loads.Load` by the names of axes, columns and options: `shear` is that along x."""
LOAD = {
    name: Quantity(known["unit"], known["low"], known["high"], known["names"], open_low=known["open_low"])
    for name, known in ((name, spec.metadata) for name, spec in LOADS.items())
} | {
    "frequency": Quantity("Hz", 0.0, open_low=True),
    "speed": Quantity("mm/s", 0.0, open_low=True),
}
"""What loads a sensor, from the metadata of `Load`, in which the tilt of the plate is in degrees. Frequency and speed
say how fast the plate moves (`studies.mechanics.timed_quantities`)."""
NUMBERS = [name for name, spec in LOADS.items() if isinstance(spec.default, float)]
"""Fields of a load that are numbers, and nothing else."""
IN_STATES = [*NUMBERS, *(name for name in LOADS if name not in NUMBERS)]
"""Fields of a load in the order of options and of solved states: numbers first."""
OF_STATES = {
    column_name(name, {"deg": "rad"}.get(unit := LOADS[name].metadata["unit"], unit)): LOADS[name]
    for name in IN_STATES
}
"""Fields of a load by the columns of a solved state, which holds them as `Load` does: angles in rad."""
METHOD = {"magnet": Quantity("1", names=("rigid", "ignored"), is_number=False)}
"""Choices of the finite elements that can vary. Models are no axis: a study sets them side by side in a row."""
OVER_D = {
    f"{name}/D": Quantity("1", 0.0 if field.low >= 0 else -math.inf, open_low=field.open_low or field.low > 0)
    for name, field in {**DESIGN, **LOAD}.items()
    if field.unit == "mm" and name != "D"
}
"""Lengths over the diameter of the beam, such as L/D and depth/D."""
AXES = {**DESIGN, **LOAD, **METHOD, **OVER_D}
"""All axes by name."""
COMMON = ("D", "L", "f", "E", "depth", "shear")
"""Axes that messages name as examples."""


def load_help(name: str, default: str = "") -> str:
    """Return the help on an option for a field of a load, with its unit.

    >>> load_help("depth", "default: 1")
    'Travel of the plate after first touch, mm; default: 1.'
    """
    known = LOADS[name].metadata
    head, *rest = known["text"].split("; ")
    head = head if known["unit"] == "1" else f"{head}, {known['unit']}"
    return "; ".join([head[0].upper() + head[1:], *rest, *([default] if default else [])]) + "."


def load_of(values: Mapping[str, Any]) -> Load:
    """Return the load of a case; a plate that is sheared sticks to the tip unless `friction` says otherwise.

    >>> load_of({"depth": 1.0, "shear": 0.5})
    Load(depth=1.0, shear_x=0.5, shear_y=0.0, friction='stick', grip=None, plate_tilt=0.0, imperfection=0.0)
    """
    grip = values.get("grip")
    # a table of grips and presses has no number where the plate grips nothing
    grip = None if grip is None or math.isnan(grip) else grip
    stick = bool(values.get("shear", 0.0) or values.get("shear_y", 0.0)) and grip is None
    fields = {"friction": "stick" if stick else "none"} | dict(values) | {"grip": grip}
    return Load(
        **{
            spec.name: math.radians(fields[name]) if spec.metadata["unit"] == "deg" else fields[name]
            for name, spec in LOADS.items()
            if name in fields
        }
    )


def values_of(load: Load) -> dict[str, Any]:
    """Return the values of a load by the names of its axes, numbers first: the inverse of `load_of`.

    >>> load_of(values_of(Load(0.5, plate_tilt=0.25, grip=None))) == Load(0.5, plate_tilt=0.25)
    True
    """
    values = {name: getattr(load, LOADS[name].name) for name in IN_STATES}
    return {
        name: math.degrees(value) if LOADS[name].metadata["unit"] == "deg" else value
        for name, value in values.items()
    }


def columns_of(design: Design) -> dict[str, Value]:
    """Return the values of a design by the columns of its fields.

    >>> columns_of(Design(D=10.0))["D_mm"]
    10.0
    """
    return {column(name): getattr(design, name) for name in DESIGN}


def column(name: str) -> str:
    """Return the name of an axis' column, with its unit.

    >>> column("D"), column("nu"), column("hall_gain"), column("plate_tilt"), column("L/D")
    ('D_mm', 'nu', 'hall_gain_V_per_T', 'plate_tilt_deg', 'L_over_D')
    """
    return column_name(name, AXES[name].unit)


def field_of(name: str) -> str:
    """Return the field that an axis varies.

    >>> field_of("L/D"), field_of("nu")
    ('L', 'nu')
    """
    return name.removesuffix("/D")


def check_name(name: str) -> None:
    """Raise BadInput unless an axis has this name."""
    if name in AXES and not AXES[name].text:
        return
    if name in FIELDS:
        raise BadInput(f"{name} is a text and no axis: state it in the design, or vary loss_factor")
    remedy = nearest(name, [axis for axis in AXES if not AXES[axis].text])
    if not remedy.startswith("did you mean"):
        remedy = f"an axis is a field of the design or the load, such as {', '.join(COMMON)}"
    if "force" in name:
        remedy = "a case states the motion of the plate (depth, shear), for given forces take magtip solve --forces"
    raise BadInput(f"there is no axis {name!r}: {remedy}")


def checked(name: str, values: Sequence[Value]) -> list[Value]:
    """Return the values of an axis, numbers as floats, after a check of their kind and range."""
    if not values:
        example = "1,2,3" if AXES[name].is_number else ",".join(AXES[name].names[:2])
        raise BadInput(f"axis {name} is empty: give values, such as {name}={example}")
    numbers = [value if isinstance(value, str) else float(value) for value in values]
    if len(set(numbers)) < len(numbers):
        raise BadInput(f"axis {name} lists a value twice: give each value once")
    for value in numbers:
        if wrong := fault(name, value):
            raise BadInput(f"every value of axis {name} {wrong}")
    return numbers


def fault(name: str, value: Value, given: object = None, *, open_low: bool = False) -> str:
    """Return what a value of a field must be, and what it is; "" if it is so.

    `given` stood in place of a value that is no number, and `open_low` allows a bound that an axis must exceed.
    """
    quantity = AXES[name]
    if quantity.text:
        return "" if isinstance(value, str) else f"must be a text; got {value if given is None else given!r}"
    if isinstance(value, str):
        wanted = [*quantity.names, *(["a number"] if quantity.is_number else [])]
        return "" if value in quantity.names else f"must be {_listed(wanted)}; got {value!r}"
    got = f"{value:g}" if given is None else repr(given)
    if not (quantity.is_number and math.isfinite(value)):
        return f"must be {'a finite number' if quantity.is_number else _listed(quantity.names)}; got {got}"
    low, high, unit = quantity.low, quantity.high, "" if quantity.unit == "1" else f" {quantity.unit}"
    above = quantity.open_low and not open_low
    if low <= value <= high and not (above and value == low):
        return ""
    least = f"be {'more than' if above else 'at least'} {low:g}{unit}"
    bound = f"lie between {low:g} and {high:g}{unit}" if math.isfinite(high) else least
    return f"must {bound}; got {value:g}"


def parse(name: str, text: str) -> list[Value]:
    """Return the values in a text a,b,c, lin:START:STOP:COUNT or log:START:STOP:COUNT.

    >>> parse("D", "6,8"), parse("depth", "lin:1:2:3"), parse("depth", "log:0.1:10:3"), parse("law", "yeoh")
    ([6.0, 8.0], [1.0, 1.5, 2.0], [0.1, 1.0, 10.0], ['yeoh'])
    """
    if not text.strip():
        return checked(name, [])
    kind, colon, rest = text.strip().partition(":")
    if colon:
        parts = [part.strip() for part in rest.split(":")]
        if kind not in SPACINGS or len(parts) != 3:
            raise BadInput(
                f"axis {name} must read a,b,c or lin:START:STOP:COUNT or log:START:STOP:COUNT; got {text!r}"
            )
        return spaced(name, SPACINGS[kind], [_value(name, part) for part in parts])
    return checked(name, [_value(name, part.strip()) for part in text.split(",")])


def _value(name: str, text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        if AXES[name].names:
            return text
        raise BadInput(f"each value of axis {name} must be a finite number; got {text!r}") from None


def spaced(name: str, kind: str, numbers: Sequence[Any]) -> list[Value]:
    """Return the values of `linspace` or `logspace` = [start, stop, count]; both ends are exact."""
    if len(numbers) != 3 or any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in numbers):
        raise BadInput(f"axis {name}: {kind} takes three numbers, start, stop and count; got {list(numbers)!r}")
    start, stop, count = (float(number) for number in numbers)
    if not (count.is_integer() and 2 <= count <= MOST_VALUES):
        raise BadInput(
            f"axis {name}: the count of {kind} must be a whole number from 2 to {MOST_VALUES}; got {count:g}"
        )
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise BadInput(f"axis {name}: start and stop of {kind} must be finite; got {start:g} and {stop:g}")
    if kind == "logspace" and not (start > 0 and stop > 0):
        raise BadInput(f"axis {name}: start and stop of logspace must be more than 0; got {start:g} and {stop:g}")
    import numpy as np

    values = (np.geomspace if kind == "logspace" else np.linspace)(start, stop, int(count))
    # the twelfth digit of such values is rounding: 0.30000000000000004 would be a depth of its own in tables
    return checked(name, [float(f"{value:.12g}") for value in values.tolist()])


def from_table(name: str, value: Any) -> list[Value]:
    """Return the values of an axis in a study file: a list, or a table with `linspace` or `logspace`."""
    if isinstance(value, Mapping):
        kinds = list(SPACINGS.values())
        if len(value) != 1 or next(iter(value)) not in kinds:
            raise BadInput(f"axis {name}: a table has one key, {' or '.join(kinds)}; got {dict(value)!r:.60}")
        ((kind, numbers),) = value.items()
        if not isinstance(numbers, list):
            raise BadInput(f"axis {name}: {kind} takes a list [start, stop, count]; got {numbers!r:.60}")
        return spaced(name, kind, numbers)
    if not isinstance(value, list):
        raise BadInput(f"axis {name} must be a list of values; got {value!r:.60}")
    for one in value:
        named = isinstance(one, str) and bool(AXES[name].names)
        if isinstance(one, bool) or not (named or isinstance(one, (int, float))):
            quantity = AXES[name]
            kinds = ["numbers"] * quantity.is_number + [f"the names {', '.join(quantity.names)}"] * bool(
                quantity.names
            )
            raise BadInput(f"axis {name} must be a list of {' or '.join(kinds)}; got {one!r:.60}")
    return checked(name, value)


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}" if len(words) > 1 else words[0]


VERSION = 2
"""Newest version of the format of study files that can be read; older ones are subsets of it."""
SAMPLINGS = ("latin-hypercube", "sobol")
"""Methods of sampling."""
MOST_SAMPLES = 1_048_576
"""Largest number of sampled points."""


@dataclass(frozen=True, slots=True)
class Study:
    """A study as a TOML file describes it; None or empty where the file does not state a value.

    design : name of a preset, or path of a design's TOML file, relative to the current folder.
    tolerance : largest relative error, which chooses the model of each case.
    """

    design: str
    fields: dict[str, Value]
    factors: tuple[Factor, ...]
    load: dict[str, Value]
    magnet: Magnet | None = None
    accuracy: AccuracyName | None = None
    models: tuple[str, ...] = ()
    quantities: tuple[str, ...] = ()
    tolerance: float | None = None

    @property
    def axes(self) -> dict[str, list[Value]]:
        """All axes with their values."""
        return {
            name: list(values)
            for factor in self.factors
            for name, values in zip(factor.names, factor.values, strict=True)
        }


def study_design(study: Study, sets: Sequence[str] = (), *, magnet: Magnet = "rigid") -> Design:
    """Return the design of a study, with overrides KEY=VALUE; of an array that of one beam, which is said."""
    base, values = user_input.preset_or_file(study.design)
    user_input.say_if_array(study.design)
    return user_input.design_from(base, {**values, **study.fields, **user_input.overrides(sets)}, magnet)


def parse_axes(axes: Sequence[str]) -> dict[str, list[Value]]:
    """Return the axes of a study from texts NAME=a,b,c, NAME=lin:... or NAME=log:..., as above.

    >>> parse_axes(["D=6,8,10", "depth=0.5,1"])
    {'D': [6.0, 8.0, 10.0], 'depth': [0.5, 1.0]}
    """
    parsed: dict[str, list[Value]] = {}
    for text in axes:
        name, equals, values = text.partition("=")
        name = name.strip()
        if not equals:
            raise BadInput(f"an axis must read NAME=a,b,c, such as D=6,8,10; got {text!r}")
        check_name(name)
        if name in parsed:
            raise BadInput(f"axis {name} is given twice: give all its values at once, {name}=a,b,c")
        parsed[name] = parse(name, values)
    if not parsed:
        raise BadInput("a sweep needs an axis, such as D=6,8,10: add --axis NAME=a,b,c")
    return parsed


def grid(axes: Mapping[str, Sequence[Value]]) -> tuple[Factor, ...]:
    """Return a factor for each axis, so that every combination of values is a case."""
    return tuple(Factor((name,), (tuple(values),)) for name, values in axes.items())


def problem(*names: str, **ranges: Sequence[float]) -> dict[str, Any]:
    """Return fields and their bounds in the form of SALib, for samples that `studies.cases.answer` takes as a table.

    Parameters
    ----------
    names : fields of design and load, such as `nu`, that reach over all their values.
    ranges : fields with their lowest and highest value in mm, MPa, T, V, Hz or degrees, such as `D=(6, 10)`. A name
        is that of an axis of `magtip sweep` or of a column: `L=(8, 12)`, `L_mm=(8, 12)`, `L_over_D=(1, 2)`.

    Returns
    -------
    dict
        `num_vars`; `names`, which are columns with their units; and `bounds`, [low, high] of each.

    Raises
    ------
    BadInput
        A field is unknown, given twice, no number, or has no finite bounds of its own.

    Examples
    --------
    >>> problem("nu", D=(6, 10), depth=(0.5, 1.0))["names"]
    ['nu', 'D_mm', 'depth_mm']

    With the samplers and methods of SALib:

    >>> import numpy as np
    >>> import pandas as pd
    >>> from SALib.analyze import sobol as indices
    >>> from SALib.sample import sobol
    >>> from studies.cases import answer
    >>> asked = problem(L=(8, 12), E=(0.5, 1.0), f=(4.5, 5.5))
    >>> points = pd.DataFrame(sobol.sample(asked, 64, seed=0), columns=asked["names"]).assign(depth_mm=0.8)
    >>> force = answer(points, ["surrogate"], quantities=["force"])["surrogate_force_N"].to_numpy()
    >>> found = indices.analyze(asked, force, seed=np.random.default_rng(0))
    >>> found["ST"].round(1).tolist()
    [0.3, 0.7, 0.0]
    """
    columns = {column(name): name for name in AXES}
    bounds: dict[str, list[float]] = {}
    for name, ends in [*((name, None) for name in names), *ranges.items()]:
        axis = columns.get(name, name)
        check_name(axis)
        if column(axis) in bounds:
            raise BadInput(f"problem: {axis} is given twice: leave one of them out")
        field = AXES[axis]
        if ends is None and field.is_number and not math.isfinite(field.high - field.low):
            raise BadInput(f"problem: {axis} has no bounds of its own: give a range, such as {axis}=(1, 2)")
        given = [field.low, field.high] if ends is None else list(ends) if isinstance(ends, Sequence) else ends
        bounds[column(axis)] = list(_range("problem", axis, given))
    if not bounds:
        raise BadInput("problem: no field is given: name some, such as D=(6, 10)")
    return {"num_vars": len(bounds), "names": list(bounds), "bounds": list(bounds.values())}


def is_study(source: str) -> bool:
    """Return whether a sweep's positional argument names a study, which is a file with axes, or else a design."""
    keys = set(user_input.toml_table(source, "preset or file"))
    if "axis" in keys:
        raise BadInput(f"{source}: there is no key 'axis': did you mean axes?")
    return bool({"axes", "zipped", "sample"} & keys)


def read_study(path: str) -> Study:
    """Read the study in a TOML file; the path of its design is relative to the file's folder."""
    table = user_input.toml_table(path, "file")
    kinds: dict[str, Any] = {
        "version": int,
        "design": str | dict[str, Any],
        "axes": dict[str, Any],
        "zipped": list[dict[str, Any]],
        "sample": dict[str, Any],
        "load": dict[str, Any],
        "depth": float | None,
        "magnet": Literal["rigid", "ignored"] | None,
        "accuracy": AccuracyName | None,
        "models": list[str],
        "tolerance": float | str | None,
        "quantities": list[str],
    }
    version = table.get("version", VERSION)
    if isinstance(version, bool) or not isinstance(version, int):
        raise BadInput(f"{path}: version must be a whole number from 1 to {VERSION}; got {version!r:.60}")
    if not 1 <= version <= VERSION:
        raise BadInput(
            f"{path}: the study has version {version}, and this version of magtip reads versions 1 to {VERSION}: "
            "install a newer magtip, or write the study anew"
        )
    values = user_input.checked(path, table, kinds)
    for name in ("models", "quantities"):
        if name in values and not values[name]:
            raise BadInput(f"{path}: {name} is empty: name one or more, or leave it out for the usual ones")
    design: Any = values.get("design", "paper")
    fields: dict[str, Value] = {}
    if isinstance(design, dict):
        design, fields = user_input.design_table(f"{path}: design", design)
    elif design not in PRESETS:
        design = str(Path(path).parent / design)
    return Study(
        design,
        fields,
        _factors(path, values),
        _load(path, values),
        values.get("magnet"),
        values.get("accuracy"),
        tuple(values.get("models", ())),
        checked_quantities(values.get("quantities", ()), f"{path}: "),
        None if values.get("tolerance") is None else user_input.parse_tolerance(str(values["tolerance"])),
    )


def checked_quantities(names: Sequence[str], where: str = "") -> tuple[str, ...]:
    """Return quantities in the order of their columns, each once; an unknown one raises BadInput."""
    for name in names:
        if name not in QUANTITIES:
            raise BadInput(f"{where}there is no quantity {name!r}: choose from {', '.join(QUANTITIES)}")
    return tuple(name for name in QUANTITIES if name in names)


def needs_load(quantities: Sequence[str]) -> bool:
    """Return whether quantities need a load; critical depths and modes alone do not, the usual ones do.

    >>> needs_load(("force", "modes")), needs_load(("critical_depth", "modes")), needs_load(())
    (True, False, True)
    """
    return not (quantities and all(QUANTITIES[name].of_sensor for name in quantities))


def _load(path: str, values: Mapping[str, Any]) -> dict[str, Value]:
    load: dict[str, Value] = {}
    for name, value in values.get("load", {}).items():
        user_input.check_keys(f"{path}: load", [name], LOAD)
        if isinstance(value, (dict, list)):
            raise BadInput(f"{path}: {name} in [load] must be one value; got {value!r:.60}: several make an axis")
        load[name] = from_table(name, [value])[0]
    depth = values.get("depth")
    if depth is None:
        return load
    if not depth > 0:
        raise BadInput(f"{path}: depth must be more than 0 mm; got {depth:g} mm")
    if "depth" in load:
        raise BadInput(f"{path}: depth is given twice, alone and in [load]: leave one of them out")
    return {"depth": float(depth), **load}


def _factors(path: str, values: Mapping[str, Any]) -> tuple[Factor, ...]:
    for name in values.get("axes", {}):
        check_name(name)
    factors = list(grid({name: from_table(name, v) for name, v in values.get("axes", {}).items()}))
    factors += [_zipped(path, group) for group in values.get("zipped", ())]
    if "sample" in values:
        factors.append(_sample(path, values["sample"]))
    if not factors:
        what = "an axis in its table [axes]" if "axes" in values else "a table [axes]"
        raise BadInput(f"{path}: a study needs {what}, with one or more of {', '.join(COMMON)}, ...")
    names = [name for factor in factors for name in factor.names]
    for name in names:
        if names.count(name) > 1:
            raise BadInput(f"{path}: {name} varies twice, in two of axes, zipped and sample: leave one of them out")
    return tuple(factors)


def _zipped(path: str, group: Mapping[str, Any]) -> Factor:
    columns: dict[str, tuple[Value, ...]] = {}
    for name, value in group.items():
        check_name(name)
        if isinstance(value, list):
            # each value by itself: an axis of a group may repeat a value, but no point
            columns[name] = tuple(from_table(name, [one])[0] for one in value)
        else:
            columns[name] = tuple(from_table(name, value))
    lengths = {name: len(column) for name, column in columns.items()}
    if not lengths or len(set(lengths.values())) > 1 or not all(lengths.values()):
        counts = ", ".join(f"{name} has {count}" for name, count in lengths.items()) or "there is none"
        raise BadInput(f"{path}: axes in [[zipped]] need the same number of values, one or more; {counts}")
    points = list(zip(*columns.values(), strict=True))
    if len(set(points)) < len(points):
        raise BadInput(f"{path}: the zipped axes {', '.join(columns)} list a point twice: give each point once")
    return Factor(tuple(columns), tuple(columns.values()))


def _sample(path: str, table: Mapping[str, Any]) -> Factor:
    where = f"{path}: sample"
    kinds = {"method": str, "count": int, "seed": int, "ranges": dict[str, Any], "log": list[str]}
    values = user_input.checked(where, table, kinds)
    method, count, seed = values.get("method", "sobol"), values.get("count", 0), values.get("seed", 0)
    if method not in SAMPLINGS:
        raise BadInput(f"{where}: method must be {' or '.join(SAMPLINGS)}; got {method!r}")
    if not 1 <= count <= MOST_SAMPLES:
        raise BadInput(f"{where}: count must be a whole number from 1 to {MOST_SAMPLES}; got {count}")
    if method == "sobol" and count & (count - 1):
        below = 1 << (count.bit_length() - 1)
        raise BadInput(f"{where}: Sobol points need a power of 2 as count; got {count}: take {below} or {2 * below}")
    if seed < 0:
        raise BadInput(f"{where}: seed must be 0 or more; got {seed}")
    ranges = {name: _range(where, name, ends) for name, ends in values.get("ranges", {}).items()}
    if not ranges:
        raise BadInput(f"{where}: there are no ranges: add a table [sample.ranges] with NAME = [low, high]")
    log = values.get("log", [])
    for name in log:
        if name not in ranges:
            raise BadInput(f"{where}: log names {name!r}, which has no range: choose from {', '.join(ranges)}")
        if not ranges[name][0] > 0:
            low = ranges[name][0]
            raise BadInput(f"{where}: the range of {name} must begin above 0 for a log scale; got {low:g}")
    from scipy.stats import qmc

    engine = qmc.Sobol if method == "sobol" else qmc.LatinHypercube
    columns = []
    for (name, (a, b)), shares in zip(ranges.items(), engine(len(ranges), rng=seed).random(count).T, strict=True):
        column = [a * (b / a) ** share if name in log else a + (b - a) * share for share in shares.tolist()]
        columns.append(tuple(min(max(float(f"{value:.12g}"), a), b) for value in column))
    return Factor(tuple(ranges), tuple(columns), sampled=True)


def _range(where: str, name: str, ends: Any) -> tuple[float, float]:
    check_name(name)
    if not AXES[name].is_number:
        raise BadInput(f"{where}: {name} has names, not numbers, so it cannot be sampled: make it an axis")
    if not isinstance(ends, list) or len(ends) != 2:
        raise BadInput(f"{where}: the range of {name} must be [low, high]; got {ends!r:.60}")
    low, high = (from_table(name, [end])[0] for end in ends)
    if isinstance(low, str) or isinstance(high, str) or not low < high:
        raise BadInput(f"{where}: the range of {name} must be [low, high] with low < high; got {ends!r:.60}")
    return low, high
