"""Statistics of the states of `accuracy` by level, scene and quantity, the goals that they miss, and its files."""

from __future__ import annotations

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from fem.physics_version import PHYSICS
from fem.results.error_estimate_rules import table_rows
from studies.output.checkpoint import solved_at
from studies.output.csv_tables import write_table
from studies.output.goals import Goal, page_lines
from studies.simulation.model_choice import rounded_up
from studies.validation import error_study_cases, pages
from studies.validation.error_study import (
    ABOUT,
    CLEAR,
    COVERAGE,
    GOALS,
    QUANTITIES,
    RESPONSES,
    SHARP,
    SHARPNESS,
    UNSTABLE,
    WIDER,
)
from studies.validation.pages import Row

FILES = ("ACCURACY.md", "accuracy.csv", "errors.png", "error_rules.csv")
"""Files that `write` writes into a folder."""
LEAST_STATES = 8
"""Coverage and sharpness of fewer states are not compared with their goals."""
COLOURS = {
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
"""Colours of the scenes, and of all states of the half model."""
TITLES = {"sideways": "sideways force", "depth": "critical depth", "stiffness": "small-shear stiffness"}
MARKERS = {"quick": "o", "standard": "s", "fine": "^"}
LEAST = 1e-3
"""Least true error of the picture, %; smaller errors are drawn at this value."""


def summary(states: Sequence[Row]) -> list[Row]:
    """Return the statistics of each level, model, scene and quantity, with the goal of the largest error."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (state["level"], _model(state), state["scene"]))
    for (level, model, scene), members in groups.items():
        for name in QUANTITIES:
            if pairs := pairs_of(members, name):
                place = {"level": level, "model": model, "scene": scene, "quantity": name}
                row = place | _statistics(pairs) | {"goal_percent": 100 * WIDER.get(scene, GOALS)[level]}
                table.append(row | {"met": _goal(row).met})
    return table


def _goal(row: Row) -> Goal:
    name = f"{row['model']} {row['scene']}, {row['quantity']}, {row['level']}, largest error"
    return Goal(name, row["max_percent"], row["goal_percent"], row["states"], "%")


def shares(states: Sequence[Row]) -> list[Row]:
    """Return the statistics of each scene and quantity over all levels, for all designs and for the odd ones."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (_model(state), state["scene"]))
    for (model, scene), members in groups.items():
        for name in QUANTITIES:
            for designs, chosen in (("all", members), ("odd", [state for state in members if state["odd"]])):
                if pairs := pairs_of(chosen, name):
                    place = {"model": model, "scene": scene, "quantity": name, "designs": designs}
                    table.append(place | _statistics(pairs))
    return table


def references(states: Sequence[Row]) -> list[Row]:
    """Return the differences between the reference and a finer mesh, percent; NaN where a value is zero."""
    where = ("design", "scene", "depth_mm", "shear_mm")
    return [
        {name: state[name] for name in where} | {f"{q}_percent": 100 * state[f"{q}_error"] for q in RESPONSES}
        for state in states
        if state["level"] == "reference" and state["status"] == "ok"
    ]


def ended_well(states: Iterable[Row]) -> list[Row]:
    """Return the states with status "ok" at levels quick, standard and fine."""
    return [state for state in states if state["status"] == "ok" and state["level"] in GOALS]


def pairs_of(states: Iterable[Row], name: str) -> list[tuple[float, float]]:
    """Return true error and estimate of a quantity in each state that has an error; an unknown estimate is NaN."""
    pairs = [(state[f"{name}_error"], state[f"{name}_estimate"]) for state in states if f"{name}_error" in state]
    return [pair for pair in pairs if math.isfinite(pair[0])]


def goals(states: Sequence[Row]) -> list[Goal]:
    """Return the goals of the study: states compared, coverage and sharpness, largest error of each level."""
    lost = sum(state["status"] not in ("ok", *UNSTABLE) for state in states)
    posed = [Goal("states without a comparison", lost, 0, len(states))]
    for row in shares(states):
        if row["designs"] != "all" or row["states"] < LEAST_STATES:
            continue
        where = f"{row['model']} {row['scene']}, {row['quantity']}"
        for name, column, bound in (
            ("true errors that are at most the estimate", "coverage", COVERAGE),
            (f"estimates that are at most {SHARP:g} times the true error", "sharpness", SHARPNESS),
        ):
            share = 100 * row[column]
            posed.append(Goal(f"{where}, {name}", share, 100 * bound, row["states"], "%", at_least=True))
    return posed + [_goal(row) for row in summary(states)]


def noise(states: Sequence[Row]) -> list[Row]:
    """Return the spread of the half model's answers over meshes of practically the same size.

    It is their relative standard deviation, percent: mean and maximum over the states.
    """
    half = [state for state in states if state["model"] == "half" and state["status"] == "ok"]
    where = ("level", "scene", "design", "magnet", "depth_mm", "shear_mm")
    vectors: dict[str, tuple[str, ...]] = {"force": ("force_x_N", "force_z_N"), "shift": ("shift_x_mm", "shift_z_mm")}
    vectors |= {"tilt": ("tilt_rad",), "sideways": ("force_x_N",)}
    spreads: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for (level, scene, *_), repeats in _grouped(half, lambda state: tuple(state[name] for name in where)).items():
        for name, columns in vectors.items():
            # a press has neither; a relative deviation would divide by mesh noise
            if len(repeats) < 2 or (scene in ("press", "pressed") and name in ("tilt", "sideways")):
                continue
            components = [[state[column] for state in repeats] for column in columns]
            size = math.hypot(*map(statistics.fmean, components))
            spreads[level, scene, name].append(math.hypot(*map(statistics.stdev, components)) / size)
    return [
        {"level": level, "scene": scene, "quantity": name, "states": len(values)}
        | {"mean_percent": 100 * statistics.fmean(values), "max_percent": 100 * max(values)}
        for (level, scene, name), values in spreads.items()
    ]


def _model(state: Row) -> str:
    return "half" if state["model"] == "half" else "section"


def _grouped(states: Iterable[Row], key: Callable[[Row], Any]) -> dict[Any, list[Row]]:
    groups: dict[Any, list[Row]] = {}
    for state in states:
        groups.setdefault(key(state), []).append(state)
    return groups


def _statistics(pairs: Sequence[tuple[float, float]]) -> Row:
    """Return the statistics of pairs of true error and estimate.

    `coverage` is the share of the states whose true error is at most the estimate, `sharpness` the share of those
    whose estimate is at most SHARP times the true error, or at most CLEAR.
    """
    true = sorted(error for error, _ in pairs)
    return {
        "states": len(pairs),
        "median_percent": 100 * statistics.median(true),
        "p95_percent": 100 * true[min(len(true) - 1, math.ceil(0.95 * len(true)) - 1)],
        "max_percent": 100 * true[-1],
        "coverage": sum(t <= e for t, e in pairs) / len(pairs),
        "sharpness": sum(e <= max(SHARP * t, CLEAR) for t, e in pairs) / len(pairs),
    }


def write(folder: Path, states: Sequence[Row], origin: str, command: str, *, quick: bool) -> None:
    """Write accuracy.csv with all states, the report ACCURACY.md, errors.png, and the rules that hold in them."""
    write_table(folder / "accuracy.csv", states, digits=9)
    write_table(folder / "error_rules.csv", rules(states))
    picture(folder / "errors.png", states)
    good, (verdict, *missed) = sum(s["status"] == "ok" for s in states), page_lines(goals(states))
    blocks = ["# Accuracy", "\n".join([f"{good} of {len(states)} states compared. {verdict}", *missed]), ABOUT]
    blocks += ["![Estimates over true errors](errors.png)"]
    blocks += ["## Estimates", pages.markdown(shares(states), digits=4)]
    blocks += ["## Levels", pages.markdown(summary(states), digits=4)]
    if spread := noise(states):
        text = "Relative standard deviation of the half model's answers over meshes whose sizes differ by 0.01 %."
        blocks += ["## Mesh noise of the half model", text, pages.markdown(spread, digits=4)]
    scenes = (("press", "press"), ("stick and grip", "stick"), ("friction", "friction"), ("tangents", "modes"))
    meshes = [f"{name}: `{error_study_cases.reference(scene, 0 if quick else 1)}`" for name, scene in scenes]
    blocks += ["## Reference meshes", pages.listed(meshes)]
    if checked := references(states):
        blocks += ["Differences between these meshes and still finer ones, relative:"]
        blocks += [pages.markdown(checked, digits=4)]
    names = ("D", "L", "nu", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    designs = error_study_cases.designs()
    chosen = [
        {"design": i} | {name: getattr(designs[i], name) for name in names}
        for i in sorted({state["design"] for state in states})
    ]
    blocks += ["## States left out", _left_out(states), "## Designs", pages.markdown(chosen, digits=6)]
    blocks += [f"Versions of the physics: {', '.join(f'{name} {number}' for name, number in PHYSICS.items())}."]
    blocks += [solved_at(state["commit"] for state in states if state.get("commit"))]
    pages.write(folder / "ACCURACY.md", blocks, command, origin)


def _left_out(states: Sequence[Row]) -> str:
    missing = sum(state["status"] == "not_run" for state in states)
    lines = [f"{missing} states were not solved within the time limit (`--minutes`)."] if missing else []
    lines += [
        f"design {state['design']}, magnet {state['magnet']}, {state['model']} {state['path']}, {state['level']}, "
        f"depth {state['depth_mm']:g} mm, shear {state['shear_mm']:g} mm: {state['status']}; {state['message']}"
        for state in states
        if state["status"] not in ("ok", "not_run")
    ]
    return pages.listed(lines)


def rules(states: Sequence[Row]) -> list[Row]:
    """Return the rows of fem/results/error_rules.csv, with c so wide that each covers COVERAGE of its states.

    Rows with states in the study get today's versions and the commits of their solves; the others stay. An estimate
    that is unknown or 0 covers no error, whatever c is, and misses its goal: c does not follow from it.
    """
    ratios: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    commits: dict[tuple[str, str, str], set[str]] = defaultdict(set)
    for state in ended_well(states):
        for name in QUANTITIES:
            for error, estimate in pairs_of([state], name):
                if estimate > 0:
                    key = _rule_of(state, name)
                    ratios[key].append(error / estimate)
                    commits[key].add(state["commit"])
    rows = []
    for row in table_rows():
        key = row["scene"], row["variant"], row["quantity"]
        if key in ratios:
            needed = sorted(ratios[key])[math.ceil(COVERAGE * len(ratios[key])) - 1]
            c = float(row["c"]) if needed <= 1 else rounded_up(needed * float(row["c"]), 3)
            today: dict[str, int] = dict(PHYSICS.items())
            row |= {"c": f"{c:g}", "version": str(today[row["model"]]), "commit": " - ".join(sorted(commits[key]))}
        rows.append(row)
    return rows


def _rule_of(state: Row, quantity: str) -> tuple[str, str, str]:
    """Return scene, magnet and quantity by which a state's rule is found, see `fem.results.error_estimate_rules`."""
    if state["model"] == "half":
        return "solid press" if state["scene"] == "press" else "solid", state["magnet"], quantity
    return (
        state["scene"],
        state["magnet"],
        "pressed frequency" if quantity == "frequency" and state["depth_mm"] else quantity,
    )


def picture(path: Path, states: Sequence[Row]) -> None:
    """Plot estimates over true errors of each quantity; between the two lines an estimate covers and is sharp."""
    from matplotlib.lines import Line2D

    from studies.output.table_plots import sheet

    with sheet(path, 11.0, 6.4, dpi=200) as figure:
        grid = figure.subplots(2, -(-len(QUANTITIES) // 2), sharex=True, sharey=True)
        axes = grid.ravel().tolist()
        for axis, name in zip(axes, QUANTITIES, strict=False):
            _scatter(axis, states, name)
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
        scenes = {_colour_key(state) for state in states}
        handles += [
            Line2D([], [], marker="o", linestyle="", color=COLOURS[n], label=n) for n in COLOURS if n in scenes
        ]
        # there is one panel more than quantities: it holds the legend
        small = {"fontsize": 9.5, "columnspacing": 1.0, "handlelength": 1.6}
        axes[-1].legend(handles=handles, loc="center", ncols=2, frameon=False, **small)


def _colour_key(state: Row) -> str:
    """Return the key of a state's colour in COLOURS."""
    return "half" if state["model"] == "half" else state["scene"]


def _scatter(axis: Any, states: Sequence[Row], name: str) -> None:
    from studies.output.table_plots import log_numbers

    for state in ended_well(states):
        for error, estimate in pairs_of([state], name):
            look = {"marker": MARKERS[state["level"]], "color": COLOURS[_colour_key(state)], "alpha": 0.55}
            axis.plot(
                max(100 * error, LEAST), 100 * estimate, linestyle="", markersize=4.5, markeredgewidth=0, **look
            )
    ends = [LEAST, 20]
    axis.plot(ends, ends, color="black", linewidth=1)
    axis.plot(ends, [SHARP * end for end in ends], color="black", linewidth=1, linestyle="--")
    axis.set(xscale="log", yscale="log", title=TITLES.get(name, name), xlim=ends, ylim=(5e-3, 20))
    for way in "xy":
        log_numbers(axis, way)
    # a number at the left end would lie upon the last one of the panel beside it
    axis.set_xticks([1e-2, 1e-1, 1, 10])
