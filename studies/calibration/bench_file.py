"""Bench files: what a test stand recorded, as one table with known columns.

A head has its unit as a suffix (S1_V, Fz_N, load_g) or in brackets (F_x [N], S1 [mV]). Known are the time, the
readings by the names of the design's elements, forces on the tip (z positive in compression), depth and shear of the
plate, temperature and the number of a run. Cells may be empty. Several files are several runs.

Of an array the column beam has the number of the beam that is pressed, 0 or nothing at rest.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from analytic import parts
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import KELVIN, BadInput, Design
from studies.inputs.table_input import COLDEST, HOTTEST, Measured, split_head
from studies.inputs.units import IN_HEADS

FORCES, MOTIONS = ("Fx_N", "Fy_N", "Fz_N"), ("depth_mm", "shear_x_mm", "shear_y_mm")
NAMES = {
    r"f_?x|force_?x": "Fx_N", r"f_?y|force_?y": "Fy_N", r"f_?z|force_?z|force|load|f": "Fz_N",
    r"depth": "depth_mm", r"shear(_?x)?": "shear_x_mm", r"shear_?y": "shear_y_mm",
    r"t|time|t_wall": "time_s", r"temp|temperature": "temperature_C",
}  # fmt: skip
"""Heads without their unit, in small letters, and the columns that they mean."""
IMPOSSIBLE = 100.0
"""Reading over the rail of its element beyond which a single cell is refused."""
NO_FORCE = 0.1
"""Force over the largest one beyond which a row of an array is not at rest."""
FEWEST = 4
"""Least number of rows with all readings and a force: three readings alone tell no more than a pose."""


@dataclass(frozen=True, slots=True, eq=False)
class Bench:
    """Rows of all files.

    Attributes
    ----------
    table : a DataFrame with the columns run, those of the readings, and the others that are there; NaN for an empty
        cell. Readings are in the elements' own unit.
    readings : names of the columns of the readings, in the order of the elements.
    understood : what was understood of each head: file, head, column, unit, number of values.
    """

    table: Any
    readings: tuple[str, ...]
    understood: Sequence[Mapping[str, Any]]

    def values(self, names: Sequence[str]) -> Array:
        """Return columns as numbers (n, k), NaN for those that are not there."""
        return np.asarray(self.table.reindex(columns=list(names)).to_numpy(dtype=float))

    @property
    def runs(self) -> list[str]:
        return list(dict.fromkeys(self.table["run"]))


def read(
    files: Sequence[Path],
    design: Design | ArrayDesign,
    columns: Mapping[str, str] | None = None,
    force_sign: float = 1.0,
) -> Bench:
    """Read bench files.

    Parameters
    ----------
    columns : heads that have other names, by the column that they mean: {"S1": "X0 [uT]"}; a minus before a head
        reverses its numbers.
    force_sign : factor on all forces, 1 or -1.

    Raises
    ------
    BadInput
        A file cannot be read, a head is ambiguous or missing, or values cannot be in the stated unit.
    """
    import pandas as pd

    elements = parts.of_design(design)
    names = tuple(parts.columns(elements))
    raw: list[Any] = []
    tables, understood = [], []
    for file in files:
        _, table, heads = _read_file(file, names, elements[0].unit, columns or {})
        if same := [other for other, earlier in zip(files, raw, strict=False) if earlier.equals(table)]:
            raise BadInput(
                f"{str(file)!r} has the same rows as {str(same[0])!r}, but each file is a run: give one of them"
            )
        raw.append(table.copy())
        label = file.name.removesuffix(".gz").removesuffix(".csv")
        table["run"] = f"{label}:" + table["run"].astype(str) if "run" in table else label
        tables.append(table)
        understood += heads
    table = pd.concat(tables, ignore_index=True)
    present = [name for name in FORCES if name in table]
    table[present] = force_sign * table[present]
    _check(table, names, present, elements[0])
    return Bench(table, names, understood)


def beams_of(bench: Bench, array: ArrayDesign) -> list[Bench]:
    """Return the rows of each beam of an array, with those at rest, as those of a single sensor.

    Raises
    ------
    BadInput
        The column beam is missing, has another number, or a beam has no rows; a row at rest has a force.
    """
    table, n = bench.table, len(array)
    if "beam" not in table:
        raise BadInput("the bench of an array has no column beam: number the beam that each row presses, 0 at rest")
    if "temperature_C" in table:
        raise BadInput("temperatures of an array's bench are not used yet: delete their column")
    beam = table["beam"].fillna(0.0)
    if len(wrong := beam[~beam.isin(range(n + 1))]):
        raise BadInput(f"beam must be a number from 1 to {n}, or 0 at rest; got {wrong.iloc[0]:g}")
    forces = table[[name for name in FORCES if name in table]].abs().max(axis=1)
    at_rest = forces[beam == 0]
    if len(pressed := at_rest[at_rest > NO_FORCE * forces.max()]):
        raise BadInput(
            f"row {int(pressed.index[0]) + 1} names no beam, but has a force of {pressed.iloc[0]:.3g} N: state which "
            "beam is pressed"
        )
    names, found = parts.columns(parts.of_design(array.design)), []
    for k in range(1, n + 1):
        if not (beam == k).any():
            raise BadInput(f"no row presses beam {k}: press each of the {n} beams")
        renamed = table.rename(columns={f"b{k}_{name}": name for name in names})
        others = [name for name in bench.readings if not name.startswith(f"b{k}_")]
        rows = renamed[(beam == 0) | (beam == k)].drop(columns=[*others, "beam"]).reset_index(drop=True)
        found.append(Bench(rows, tuple(names), bench.understood))
    return found


def read_readings(file: Path, design: Design | ArrayDesign) -> tuple[Any, Array, Array | None, Array]:
    """Return the cells of a table as texts, readings (n, k) in the elements' own unit, times and temperatures.

    Readings and temperatures (n,), C, are NaN where empty. There are no times (n,), s, without their column.
    """
    elements = parts.of_design(design)
    names = parts.columns(elements)
    raw, table, _ = _read_file(file, names, elements[0].unit, None)
    readings, temperature = (
        np.asarray(table.reindex(columns=which).to_numpy(dtype=float)) for which in (names, ["temperature_C"])
    )
    if "time_s" not in table:
        return raw, readings, None, temperature[:, 0]
    times = np.asarray(table["time_s"].to_numpy(dtype=float))
    if np.isnan(times).any():
        raise BadInput(f"{file.name}, row {int(np.isnan(times).argmax()) + 1} has no time: give it one, or delete it")
    return raw, readings, times, temperature[:, 0]


def _read_file(
    file: Path, names: Sequence[str], unit: str, columns: Mapping[str, str] | None
) -> tuple[Any, Any, list[dict[str, Any]]]:
    import pandas as pd

    raw = Measured(file)
    given, reversed_ = _named(columns or {}, raw.heads)
    if lost := [head for head in given if head not in raw.heads]:
        raise BadInput(f"{file.name} has no column {lost[0]!r}: --column names one of {', '.join(raw.heads)}")
    if twice := [head for head in raw.heads if raw.heads.count(head) > 1]:
        raise BadInput(f"{file.name} has the column {twice[0]!r} twice: rename or delete one")
    found: dict[str, str] = {}
    table, heads = dict[str, Any](), []
    for head in raw.heads:
        column, named, sign = _meaning(head, given.get(head), names, unit)
        understood = {"file": file.name, "head": head, "column": column or "not used", "unit": named, "values": 0}
        heads.append(understood)
        if not column:
            continue
        if column in found:
            raise BadInput(
                f"{file.name}: the columns {found[column]!r} and {head!r} both mean {column}: rename or delete one"
            )
        found[column] = head
        if column == "run":
            table[column] = raw.cells(head)
        elif column == "beam":
            table[column] = raw.numbers(head, holes=True)
        else:
            table[column] = raw.numbers(head, holes=True) * (-sign if head in reversed_ else sign) * _factor(named)
        if column == "temperature_C":
            table[column] -= KELVIN * (named == "K")
            _check_temperatures(raw, head, table[column])
        understood["values"] = sum(map(bool, raw.cells(head)))
    if missing := [name for name in names if name not in table]:
        raise BadInput(
            f"{file.name} has no reading {missing[0]}: this design has the elements {', '.join(names)}; name its "
            f"column {missing[0]}_{unit}{'' if columns is None else f', or give --column {missing[0]}=HEAD'}"
        )
    if "time_s" in table and (np.diff(table["time_s"][np.isfinite(table["time_s"])]) < 0).any():
        raise BadInput(
            f"{file.name}: the times of {found['time_s']!r} fall: sort the rows, or give each run its file"
        )
    return pd.DataFrame({head: raw.cells(head) for head in raw.heads}), pd.DataFrame(table), heads


def _named(columns: Mapping[str, str], heads: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """Return the column that each named head means, and the heads whose numbers are to be reversed."""
    given, reversed_ = {}, set()
    for name, head in columns.items():
        found = head.strip()
        if found not in heads and found.startswith("-"):
            found = found[1:].strip()
            reversed_.add(found)
        given[found] = name
    return given, reversed_


def _check_temperatures(raw: Measured, head: str, values: Array) -> None:
    wrong = (values <= COLDEST) | (values >= HOTTEST)
    advice = f": degrees Celsius are kelvin less {KELVIN:g}" if (values[wrong] > HOTTEST).any() else ""
    raw.refuse(
        wrong, head, f"a temperature must lie between {COLDEST:g} and {HOTTEST:g} C", values, f" C: check it{advice}"
    )


def _meaning(head: str, given: str | None, names: Sequence[str], unit: str) -> tuple[str, str, float]:
    """Return the column that a head means, its unit, and the sign of its numbers; two empty texts if it is not used.

    The element that measures a chip's axis z from above is chip_-z; chip_z is the chip's own axis.
    """
    stem, named = split_head(head)
    if (own_name := head.strip().lower()) in ("run", "beam"):
        return own_name, "", 1.0
    name = given or stem
    own = {each.lower(): (each, 1.0) for each in names}
    own |= {each.lower().replace("_-", "_"): (each, -1.0) for each in names if "_-" in each}
    element, sign = own.get(name.strip().lower(), (None, 1.0))
    column = element or next((each for text, each in NAMES.items() if re.fullmatch(text, name.lower())), None)
    if given and column is None:
        if given not in (others := (*FORCES, *MOTIONS, "time_s", "temperature_C")):
            raise BadInput(f"--column {given}: choose one of {', '.join([*names, *others])}")
        column = given
    if column is None:
        return "", "", 1.0
    wanted = unit if element else column.rpartition("_")[2]
    if named not in IN_HEADS[wanted]:
        whole = name if any(named in factors for factors in IN_HEADS.values()) else head.strip()
        raise BadInput(
            f"the column {head!r} has no unit that {'a reading' if element else column.rpartition('_')[0]} can have: "
            f"write one of {', '.join(IN_HEADS[wanted])} behind its name, as in {whole}_{wanted}"
        )
    return column, named, sign


def _factor(unit: str) -> float:
    return next(factors[unit] for factors in IN_HEADS.values() if unit in factors)


def _check(table: Any, names: Sequence[str], forces: Sequence[str], element: parts.Element) -> None:
    """Refuse a bench without forces or with impossible values."""
    if not forces:
        raise BadInput(
            "the bench has no force: name a column Fz_N (or load_g), and Fx_N and Fy_N if they were measured"
        )
    for name in names:
        values = table[name].dropna()
        if len(values) and values.nunique() == 1 and len(table) >= FEWEST:
            raise BadInput(
                f"all readings of {name} are {values.iloc[0]:g} {element.unit}: an element that is not read"
            )
        # a voltage is positive, a flux density is not
        least = element.low / 2 if element.unit == "V" else 1.5 * element.low
        beyond = (values < least) | (values > 1.5 * element.high)
        if beyond.mean() > 0.5 or (values.abs() > IMPOSSIBLE * element.high).any():
            raise BadInput(
                f"readings of {name} such as {values[beyond].iloc[0]:.4g} {element.unit} cannot be: this element "
                f"reads from {element.low:g} to {element.high:g} {element.unit}: check the unit of its column"
            )
    for name in forces:
        values = table[name].dropna()
        if values.nunique() == 1 and len(values) >= FEWEST:
            raise BadInput(
                f"all forces {name} are {values.iloc[0]:g} N: press to different forces, or leave out the column of "
                "a component that is not measured"
            )
    pressed = table["Fz_N"].dropna() if "Fz_N" in table else table[forces[0]].iloc[:0]
    if (pressed <= 0).all() and (pressed < 0).any():
        raise BadInput("all forces along z are negative, but a press is positive: use --force-sign -1")
    read, felt = table[[*names]].notna().all(axis=1), table[list(forces)].notna().any(axis=1)
    if (count := int((read & felt).sum())) < FEWEST:
        counted = {0: "no row has", 1: "only 1 row has"}.get(count, f"only {count} rows have")
        raise BadInput(
            f"{counted} all readings and a force: a calibration needs at least {FEWEST}{_apart(table, read, felt)}"
        )


def _apart(table: Any, read: Any, felt: Any) -> str:
    """Return what is wrong with rows of which some have readings (n,) and others forces (n,), in words."""
    if min(read.sum(), felt.sum()) < FEWEST:
        return ""
    if "time_s" not in table:
        return "; readings and forces stand in different rows"
    ends = [(float(times.min()), float(times.max())) for times in (table["time_s"][read], table["time_s"][felt])]
    (a, b), (c, d) = ends
    if max(a, c) > min(b, d):
        return (
            f"; the times of the readings, {a:g} to {b:g} s, and of the forces, {c:g} to {d:g} s, do not overlap: "
            "use one clock"
        )
    return "; readings and forces stand in different rows: interpolate the forces to the times of the readings"
