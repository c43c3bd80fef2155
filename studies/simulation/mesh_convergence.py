"""How the answer to a load converges with the mesh: order, limit and its bar (`magtip converge`).

The load is solved on a sequence of meshes. From one to the next every edge length, and the load increments with
friction, are divided by one ratio; the first has those of level quick, and all have the harmonics of level fine.
Through the three finest goes f + C h^p (Richardson): limit f and order p. Its bar is Roache's grid convergence index,
1.25 times the difference from the finest mesh that an order of at most `HIGHEST` gives.

Limits
------
The meshes are of similar edge lengths and not nested: the places of their points scatter the answers, a press of the
paper's sensor by some 1e-4. Where the three finest do not approach one side ever more slowly, the limit is unknown,
and the scatter of the three says how far they agree.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from scipy.optimize import brentq

from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies.output import page_templates
from studies.output.figures import FREE, LOG, Figure, numbers, panels, picture, rule, styles, texts
from studies.output.records import FlatRow
from studies.output.result import Result, Table, collected, failure_of

if TYPE_CHECKING:
    import pandas as pd

    from fem.accuracy import Accuracy
    from fem.solution import Solution

FILES = ("converge.csv", "orders.csv", "converge.png", "CONVERGE.md")
LEAST_LEVELS, MOST_LEVELS = 4, 8
RATIOS = (1.2, 4.0)
FINEST = 0.004
"""Least section size over D: a tenth of level fine, with a hundred times its unknowns."""
ORDERS = (0.2, 8.0)
HIGHEST = 2.0
"""Order above which the bar does not count it: a higher one from three meshes is luck more often than smoothness."""
SAFETY = 1.25
"""Roache's factor of the grid convergence index for three meshes or more."""
ZERO = 1e-9
"""Share of the largest value of a vector below which a component is zero by symmetry."""
SIZES = ("coarseness", "solid_size", "solid_patch", "friction_step_factor")
"""What the ratio divides: of a section every edge length, those at fillets, corners and in thin layers too."""
OF_ONE_RATIO, LIMIT = "meshes of one ratio", "limit with its bar"
NAN = math.nan


def run(
    design: Design, loads: Sequence[Load], magnet: Magnet, count: int, ratio: float, progress: Progress
) -> Result:
    """Solve the last of the loads on `count` meshes, and at levels quick, standard and fine."""
    from fem.scene import Scene

    meshes = sequence(count, ratio)
    # a load that is impossible is refused before the first mesh
    Scene(design, tuple(loads), meshes["quick"], magnet)

    def rows() -> Iterator[FlatRow]:
        for k, (name, accuracy) in enumerate(meshes.items()):
            progress(k / len(meshes), f"mesh {name}: size {accuracy.section_size * accuracy.coarseness:.3g} D")
            yield _row(name, accuracy, design, loads, magnet)

    return collected(rows(), partial(_result, design=design, load=loads[-1], ratio=ratio))


def sequence(count: int, ratio: float) -> dict[str, Accuracy]:
    """Return levels quick, standard and fine, and the accuracies of the sequence, by the names of their meshes.

    >>> [(name, a.section_size * a.coarseness, a.harmonics) for name, a in sequence(4, 2.0).items()][2:5]
    [('fine', 0.045, 4), ('1', 0.16, 4), ('2', 0.08, 4)]
    """
    from fem.accuracy import FINE, LEVELS, QUICK

    if not LEAST_LEVELS <= count <= MOST_LEVELS:
        raise BadInput(f"--levels must be a whole number between {LEAST_LEVELS} and {MOST_LEVELS}; got {count}")
    if not RATIOS[0] <= ratio <= RATIOS[1]:
        raise BadInput(f"--ratio must lie between {RATIOS[0]:g} and {RATIOS[1]:g}; got {ratio:g}")
    if not (finest := QUICK.section_size / ratio ** (count - 1)) >= FINEST:
        raise BadInput(
            f"the finest of {count} meshes would have edges of {finest:.2g} D, and {FINEST:g} D is the least: "
            "take fewer --levels or a smaller --ratio"
        )
    found = dict(LEVELS)
    for k in range(count):
        sizes = {size: getattr(QUICK, size) / ratio**k for size in SIZES}
        found[str(k + 1)] = replace(QUICK, name=f"mesh {k + 1}", harmonics=FINE.harmonics, **sizes)
    return found


def _row(name: str, accuracy: Accuracy, design: Design, loads: Sequence[Load], magnet: Magnet) -> FlatRow:
    from fem.equilibrium import trace

    size = accuracy.section_size * accuracy.coarseness
    row: FlatRow = {"mesh": name, "section_size_over_D": size, "harmonics": accuracy.harmonics}
    begin = time.process_time()
    try:
        state = trace(design, loads, accuracy, magnet=magnet, estimate=False)[-1]
    except SolveFailed as error:
        return row | {
            "unknowns": None,
            "cpu_s": time.process_time() - begin,
            "status": "failed",
            "message": str(error),
        }
    row |= {"unknowns": state.dofs, "cpu_s": time.process_time() - begin}
    values = _values(state) if state.status in ANSWERED else {}
    # what only a solve with error estimates checks is not said of every mesh
    return row | values | {"status": state.status, "message": "" if state.status == "ok" else state.message}


def _values(state: Solution) -> dict[str, float]:
    response = state.response
    vectors = {"force": ("N", response.force), "shift": ("mm", response.shift)}
    found = {
        f"{name}_{axis}_{unit}": value
        for name, (unit, vector) in vectors.items()
        for axis, value in zip("xyz", vector, strict=True)
        if abs(value) > ZERO * max(map(abs, vector))
    }
    tilts = {"tilt_rad": response.tilt, "tilt_y_rad": response.tilt_y}
    found |= {name: value for name, value in tilts.items() if abs(value) > ZERO}
    if response.contact_radius:
        found["contact_radius_mm"] = response.contact_radius
    return found | {"energy_mJ": state.energy}


def _result(rows: Sequence[FlatRow], design: Design, load: Load, ratio: float) -> Result:
    own = [row for row in rows if row["mesh"].isdecimal()]
    columns = list(dict.fromkeys(name for row in rows for name in row))
    quantities = [name for name in columns if own and name.rpartition("_")[2] in ("N", "mm", "rad", "mJ")]
    orders = [_order(name, [row.get(name, NAN) for row in own], ratio, rows) for name in quantities]
    table = [row | _differences(row, orders) for row in rows]
    worst = next((row for row in rows if row["status"] != "ok"), {"status": "ok", "message": ""})
    record: FlatRow = {
        **{name: worst[name] for name in ("status", "message")},
        "depth_mm": load.depth, "shear_mm": load.shear_x, "shear_y_mm": load.shear_y, "ratio": ratio,
        "meshes": list(rows), "convergence": orders,
    }  # fmt: skip
    page = page_templates.rendered(
        Path(__file__).with_name("templates") / "CONVERGE.md.j2",
        rows=rows, orders=orders, load=load, design=design, ratio=ratio, highest=HIGHEST,
        columns={name: name for name in columns},
    )  # fmt: skip
    return Result(
        title="Convergence",
        records=[record],
        shown=[
            Table(title="Meshes", rows=rows, first=("mesh", *quantities[:2], "status"), places=("mesh",)),
            Table(title="Convergence", rows=orders, first=("quantity", "order", "limit", "bar")),
        ],
        tables={"converge": table, "orders": orders},
        digits=9,
        files={"converge.png": partial(picture, rows=table, draw=figures)},
        pages={"CONVERGE.md": page},
        failures=failure_of(rows),
    )


def _order(name: str, values: Sequence[float], ratio: float, rows: Sequence[FlatRow]) -> FlatRow:
    """Return order, limit and bar of a quantity, and the differences of the levels from its limit, %."""
    limit, order = richardson([ratio**k for k in range(len(values))], values)
    known = math.isfinite(limit)
    bar = SAFETY * abs(values[-1] - values[-2]) / (ratio ** min(order, HIGHEST) - 1) if known else NAN
    from_ = limit if known else values[-1]
    levels = {
        f"{row['mesh']}_percent": 100 * (row.get(name, NAN) - from_) / abs(from_)
        for row in rows
        if not row["mesh"].isdecimal()
    }
    return {
        "quantity": name,
        "order": order,
        "limit": limit,
        "bar": bar,
        "bar_percent": 100 * bar / abs(limit),
        "finest": values[-1],
        "scatter_percent": 100 * (max(values[-3:]) - min(values[-3:])) / abs(values[-1]),
        "differences_from": "limit" if known else "finest mesh",
        **levels,
        "message": "" if known else "the three finest meshes do not converge monotonically: the limit is unknown",
    }


def _differences(row: FlatRow, orders: Sequence[FlatRow]) -> FlatRow:
    found: FlatRow = {}
    for order in orders:
        name = order["quantity"].rpartition("_")[0]
        from_ = order["limit"] if order["differences_from"] == "limit" else order["finest"]
        found[f"{name}_difference_percent"] = 100 * (row.get(order["quantity"], NAN) - from_) / abs(from_)
        found[f"{name}_bar_percent"] = order["bar_percent"]
    return found


def richardson(meshes: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Return limit f and order p of f + C / n^p through the three finest meshes; NaN if no p in `ORDERS` fits.

    >>> f, p = richardson((2, 4, 6), [1 + n**-1.5 for n in (2, 4, 6)])
    >>> round(f, 10), round(p, 10)
    (1.0, 1.5)
    >>> richardson((1, 2, 4), (1.0, 2.0, 1.5))
    (nan, nan)
    """
    if len(values) < 3:
        return NAN, NAN
    (a, b, c), (f, g, h) = (float(n) for n in meshes[-3:]), values[-3:]
    if not all(map(math.isfinite, (f, g, h))) or f == g or (h - g) / (g - f) <= 0:
        return NAN, NAN

    def excess(p: float) -> float:
        return float((b**-p - c**-p) / (a**-p - b**-p)) - (h - g) / (g - f)

    if excess(ORDERS[0]) * excess(ORDERS[1]) > 0:
        return NAN, NAN
    p = float(brentq(excess, *ORDERS, xtol=1e-13))
    return float(h + (h - g) * c**-p / (b**-p - c**-p)), p


def figures(table: pd.DataFrame) -> list[Figure]:
    """Return the differences of all meshes from the limits over the section size; rows of converge.csv."""
    import altair as alt
    import pandas as pd

    x, y, end = "section size over D", "difference (%)", "_difference_percent"
    level = ~texts(table, "mesh").str.fullmatch(r"\d+")
    parts = []
    for column in (name for name in table if name.endswith(end)):
        name = column.removesuffix(end)
        part = pd.DataFrame({x: numbers(table, "section_size_over_D"), y: numbers(table, column)})
        bar = numbers(table, f"{name}_bar_percent").max()
        panel = f"{name.replace('_', ' ')}, from the {'limit' if math.isfinite(bar) else 'finest mesh'}"
        series = texts(table, "mesh").where(level, OF_ONE_RATIO)
        part = part.assign(panel=panel, series=series, point=texts(table, "mesh"), joined=False)
        # points, those of levels above the others, and a line through those of one ratio
        parts += [part[~level].assign(joined=True), part[~level], part[level]]
        if math.isfinite(bar):
            ends = pd.DataFrame({x: [part[x].min(), part[x].max()], y: 0.0, "low": -bar, "high": bar})
            parts.append(ends.assign(panel=panel, series=LIMIT, point="limit", joined=True))
    data = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({x: [], y: [], "series": [], "joined": []})
    caption = "All edge lengths fall with the section size. Differences are from the limit, else the finest mesh."
    names = (OF_ONE_RATIO, "quick", "standard", "fine", LIMIT)
    data = data.dropna(subset=[x, y], ignore_index=True)
    base = alt.Chart().encode(x=alt.X(x, **LOG), y=alt.Y(y, **FREE))
    band = base.transform_filter("isValid(datum.low)").mark_area(opacity=0.18).encode(
        y=alt.Y("low:Q", title=y), y2="high:Q", **styles(names, "color")
    )  # fmt: skip
    line = base.transform_filter("datum.joined").mark_line().encode(**styles(names, "color"))
    points = base.transform_filter("!datum.joined").mark_point().encode(**styles(names, lines=(LIMIT,)))
    layers = [band, line] if "low" in data else [line]
    chart = panels(alt.layer(*rule("y", 0.0), *layers, points), data, own="xy")
    return [Figure("Convergence with the mesh", caption, chart, data)]
