"""What the rows of `accuracy` amount to: statistics, verdicts, the table to read and the picture."""

from __future__ import annotations

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from studies.output.atomic_files import atomic, write_text
from studies.output.csv_tables import write_table
from studies.output.provenance import made
from studies.validation import error_study, error_study_cases
from studies.validation.error_study import CLEAR, COVERAGE, GOALS, QUANTITIES, RESPONSES, SHARP, SHARPNESS, WIDER, Row

LOOKS = {
    "press": "#0072B2",
    "deep": "#000000",
    "pressed": "#56B4E9",
    "stick": "#D55E00",
    "far": "#882255",
    "grip": "#009E73",
    "friction": "#E69F00",
    "half": "#CC79A7",
    "critical": "#999999",
    "small shear": "#F0E442",
    "modes": "#6A3D9A",
}
TITLES = {"sideways": "sideways force", "depth": "critical depth", "stiffness": "small-shear stiffness"}
MARKERS = {"quick": "o", "standard": "s", "fine": "^"}
COMPONENTS = {
    "force": ("force_x_N", "force_z_N"),
    "shift": ("shift_x_mm", "shift_z_mm"),
    "tilt": ("tilt_rad",),
    "sideways": ("force_x_N",),
}
LEAST = 1e-3
"""Least true error in the picture, %; smaller ones are drawn there."""
LEAST_STATES = 8
"""Fewer states than this allow no verdict on shares."""


def summary(rows: Sequence[Row]) -> list[Row]:
    """Statistics of each level, model, scene and quantity, in that order."""
    good = _judged(rows)
    groups = _grouped(good, lambda row: (row["level"], _model(row), row["scene"]))
    found = []
    for (level, model, scene), members in groups.items():
        for name in QUANTITIES:
            pairs = pairs_of(members, name)
            if pairs:
                head = {"level": level, "model": model, "scene": scene, "quantity": name}
                found.append(head | _statistics(pairs) | _goal(level, scene, [true for true, _ in pairs]))
    return found


def shares(rows: Sequence[Row]) -> list[Row]:
    """Coverage and sharpness of each scene and quantity over all levels, of all designs and of the odd ones."""
    good = _judged(rows)
    found = []
    for (model, scene), members in _grouped(good, lambda row: (_model(row), row["scene"])).items():
        for name in QUANTITIES:
            for designs, chosen in (("all", members), ("odd", [row for row in members if row["odd"]])):
                pairs = pairs_of(chosen, name)
                if pairs:
                    head = {"model": model, "scene": scene, "quantity": name, "designs": designs}
                    found.append(head | _statistics(pairs))
    return found


def references(rows: Sequence[Row]) -> list[Row]:
    """How far the reference is from a finer mesh, in percent of each quantity."""
    good = [row for row in rows if row["level"] == "reference" and row["status"] == "ok"]
    return [
        {key: row[key] for key in ("design", "scene", "depth_mm", "shear_mm")}
        | {f"{name}_percent": 100 * row[f"{name}_error"] for name in RESPONSES}
        for row in good
    ]


def _judged(rows: Iterable[Row]) -> list[Row]:
    """The states of the levels that ended well."""
    return [row for row in rows if row["status"] == "ok" and row["level"] in GOALS]


def pairs_of(rows: Iterable[Row], name: str) -> list[tuple[float, float]]:
    """True error and estimate of a quantity in the rows that have both."""
    pairs = [(row[f"{name}_error"], row[f"{name}_estimate"]) for row in rows if f"{name}_error" in row]
    return [(true, estimate) for true, estimate in pairs if math.isfinite(true) and math.isfinite(estimate)]


def verdicts(rows: Sequence[Row]) -> list[str]:
    """One sentence for each promise that is not kept."""
    said = []
    for row in shares(rows):
        if row["designs"] != "all" or row["states"] < LEAST_STATES:
            continue
        where = f"{row['model']} {row['scene']}, {row['quantity']}"
        if not row["coverage"] >= COVERAGE:
            said.append(f"{where}: {row['coverage']:.0%} of the true errors lie below the estimate")
        if not row["sharpness"] >= SHARPNESS:
            said.append(f"{where}: {row['sharpness']:.0%} of the estimates lie below {SHARP:g} true errors")
    for row in summary(rows):
        if not row["met"]:
            where = f"{row['model']} {row['scene']}, {row['quantity']}, {row['level']}"
            said.append(f"{where}: an error of {row['max_percent']:.2g} %, goal {row['goal_percent']:g} %")
    return said


def noise(rows: Sequence[Row]) -> list[Row]:
    """Relative standard deviation of the half model's answers over its meshes: mean and greatest of the states."""
    half = [row for row in rows if row["model"] == "half" and row["status"] == "ok"]
    names = ("level", "scene", "design", "magnet", "depth_mm", "shear_mm")
    states = _grouped(half, lambda row: tuple(row[name] for name in names))
    spreads = defaultdict(list)
    for (level, scene, *_), repeats in states.items():
        if len(repeats) < 2:
            continue
        for name in RESPONSES:
            if scene in ("press", "pressed") and name in ("tilt", "sideways"):
                continue
            values = [[row[key] for row in repeats] for key in COMPONENTS[name]]
            size = math.hypot(*(statistics.fmean(v) for v in values))
            spreads[level, scene, name].append(math.hypot(*map(statistics.stdev, values)) / size)
    head = ("level", "scene", "quantity")
    return [
        dict(zip(head, group, strict=True))
        | {"states": len(found), "mean_percent": 100 * statistics.fmean(found), "max_percent": 100 * max(found)}
        for group, found in spreads.items()
    ]


def _model(row: Row) -> str:
    return "half" if row["model"] == "half" else "section"


def _grouped(rows: Iterable[Row], key: Callable[[Row], tuple[Any, ...]]) -> dict[tuple[Any, ...], list[Row]]:
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def _statistics(pairs: Sequence[tuple[float, float]]) -> Row:
    true = sorted(error for error, _ in pairs)
    return {
        "states": len(pairs),
        "median_percent": 100 * statistics.median(true),
        "p95_percent": 100 * true[min(len(true) - 1, math.ceil(0.95 * len(true)) - 1)],
        "max_percent": 100 * true[-1],
        "coverage": sum(t <= e for t, e in pairs) / len(pairs),
        "sharpness": sum(e <= max(SHARP * t, CLEAR) for t, e in pairs) / len(pairs),
    }


def _goal(level: str, scene: str, true: Sequence[float]) -> Row:
    goal = WIDER.get(scene, GOALS)[level]
    return {"goal_percent": 100 * goal, "met": max(true) <= goal}


def write(folder: Path, rows: Sequence[Row], origin: str, command: str, *, quick: bool) -> None:
    """accuracy.csv with all states, ACCURACY.md to read, errors.png."""
    write_table(folder / "accuracy.csv", rows, digits=9)
    picture(folder / "errors.png", rows)
    good, missed = sum(row["status"] == "ok" for row in rows), verdicts(rows)
    lines = ["# Accuracy", "", f"{good} of {len(rows)} states compared. "]
    lines[-1] += f"{len(missed)} promises are not kept." if missed else "All promises are kept."
    lines += ["", *(f"- {sentence}" for sentence in missed)] if missed else []
    lines += ["", *error_study.ABOUT.splitlines(), "", "![Estimates over true errors](errors.png)", ""]
    lines += ["## Estimates", "", *_markdown(shares(rows)), "", "## Levels", "", *_markdown(summary(rows)), ""]
    if spread := noise(rows):
        lines += [
            "## Mesh noise of the half model",
            "",
            "Standard deviation over meshes.",
            "",
            *_markdown(spread),
            "",
        ]
    lines += ["## Reference meshes", "", *_references(0 if quick else 1), ""]
    if checked := references(rows):
        lines += ["Against one more refinement:", "", *_markdown(checked), ""]
    lines += ["## States left out", "", *_left_out(rows), "", "## Designs", "", *_designs(rows), ""]
    write_text(folder / "ACCURACY.md", "\n".join([*lines, made(command, origin)]) + "\n")


def _references(fineness: int) -> list[str]:
    scenes = (("press", "press"), ("stick and grip", "stick"), ("friction", "friction"), ("tangents", "modes"))
    return [f"- {name}: `{error_study_cases.reference(scene, fineness)}`" for name, scene in scenes]


def _left_out(rows: Sequence[Row]) -> list[str]:
    missing = sum(row["status"] == "not_run" for row in rows)
    bad = [row for row in rows if row["status"] not in ("ok", "not_run")]
    said = [f"- {missing} states were not solved: the time was up."] if missing else []
    said += [
        f"- design {row['design']}, magnet {row['magnet']}, {row['model']} {row['path']}, {row['level']}, depth "
        f"{row['depth_mm']:g} mm, shear {row['shear_mm']:g} mm: {row['status']}; {row['message']}"
        for row in bad
    ]
    return said or ["None."]


def _designs(rows: Sequence[Row]) -> list[str]:
    names = ("D", "L", "nu", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    chosen = sorted({row["design"] for row in rows})
    values = [{name: f"{getattr(error_study_cases.designs()[i], name):g}" for name in names} for i in chosen]
    return _markdown([{"design": i} | value for i, value in zip(chosen, values, strict=True)])


def _markdown(rows: Sequence[Row]) -> list[str]:
    heads = list(rows[0]) if rows else []
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    return [*lines, *("| " + " | ".join(_cell(row[head]) for head in heads) + " |" for row in rows)]


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else ""
    return str(value)


def picture(path: Path, rows: Sequence[Row]) -> None:
    """Estimate over true error of each quantity; between the lines an estimate is both safe and sharp."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from studies.output.table_plots import STYLE

    with mpl.rc_context(STYLE), atomic(path) as temporary:
        figure = Figure(figsize=(11.0, 6.4), layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(2, -(-len(QUANTITIES) // 2), sharex=True, sharey=True)
        axes = grid.ravel().tolist()
        for axis, name in zip(axes, QUANTITIES, strict=False):
            _scatter(axis, rows, name)
            axis.tick_params(labelbottom=True)
        for unused in axes[len(QUANTITIES) :]:
            unused.set_axis_off()
        for first in grid[:, 0]:
            first.set_ylabel("estimate (%)")
        figure.supxlabel("true error (%)")
        grey: dict[str, Any] = {"color": "#555555", "linestyle": ""}
        handles = [Line2D([], [], marker=mark, label=level, **grey) for level, mark in MARKERS.items()]
        lines = {"estimate = error": "-", f"estimate = {SHARP:g} errors": "--"}
        handles += [Line2D([], [], color="black", linewidth=1, linestyle=a, label=text) for text, a in lines.items()]
        seen = {_colour(row) for row in rows}
        handles += [Line2D([], [], marker="o", linestyle="", color=LOOKS[n], label=n) for n in LOOKS if n in seen]
        # in the panel that is left over
        small = {"fontsize": 9.5, "columnspacing": 1.0, "handlelength": 1.6}
        axes[-1].legend(handles=handles, loc="center", ncols=2, frameon=False, **small)
        figure.savefig(temporary, dpi=200)


def _colour(row: Row) -> str:
    return "half" if row["model"] == "half" else str(row["scene"])


def _scatter(axis: Any, rows: Sequence[Row], name: str) -> None:
    for row in _judged(rows):
        if pairs_of([row], name):
            true, estimate = max(100 * row[f"{name}_error"], LEAST), 100 * row[f"{name}_estimate"]
            look = {"marker": MARKERS[row["level"]], "color": LOOKS[_colour(row)], "alpha": 0.55}
            axis.plot(true, estimate, linestyle="", markersize=4.5, markeredgewidth=0, **look)
    ends = [LEAST, 20]
    axis.plot(ends, ends, color="black", linewidth=1)
    axis.plot(ends, [SHARP * end for end in ends], color="black", linewidth=1, linestyle="--")
    axis.set(xscale="log", yscale="log", title=TITLES.get(name, name), xlim=ends, ylim=(5e-3, 20))
    axis.set_xticks([1e-3, 1e-2, 1e-1, 1, 10], ["0.001", "0.01", "0.1", "1", "10"])
