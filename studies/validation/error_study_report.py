"""Files of the study of error estimates: accuracy.csv, ACCURACY.md, errors.png and error_rules.csv."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fem.physics_version import PHYSICS
from fem.results.error_estimate_rules import table_rows
from studies.output.atomic_files import write_text
from studies.output.checkpoint import solved_at
from studies.output.csv_tables import write_table
from studies.output.goals import page_lines
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.simulation.model_choice import rounded_up
from studies.validation import error_statistics, error_study, error_study_cases
from studies.validation.error_study import COVERAGE, QUANTITIES, SHARP
from studies.validation.error_study_records import ErrorState

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


def write(folder: Path, states: Sequence[ErrorState], origin: str, command: str, *, quick: bool) -> None:
    """Write accuracy.csv with all states, the report ACCURACY.md, errors.png, and the rules that hold in them."""
    write_table(folder / "accuracy.csv", [state.row() for state in states], digits=9)
    write_table(folder / "error_rules.csv", rules(states))
    picture(folder / "errors.png", states)
    good, (verdict, *missed) = sum(s.status == "ok" for s in states), page_lines(error_statistics.goals(states))
    estimates = [one.row() for one in error_statistics.shares(states)]
    levels = [one.row() for one in error_statistics.summary(states)]
    lines = ["# Accuracy", "", f"{good} of {len(states)} states compared. {verdict}", *missed]
    lines += ["", *error_study.ABOUT.splitlines(), "", "![Estimates over true errors](errors.png)", ""]
    lines += ["## Estimates", "", *_markdown(estimates), "", "## Levels", "", *_markdown(levels), ""]
    if noise := error_statistics.noise(states):
        lines += [
            "## Mesh noise of the half model",
            "",
            "Relative standard deviation of the half model's answers over meshes whose sizes differ by 0.01 %.",
            "",
        ]
        lines += [*_markdown([one.row() for one in noise]), ""]
    lines += ["## Reference meshes", "", *_references(0 if quick else 1), ""]
    if checked := error_statistics.references(states):
        lines += [
            "Differences between these meshes and still finer ones, relative:",
            "",
            *_markdown([one.row() for one in checked]),
            "",
        ]
    lines += ["## States left out", "", *_left_out(states), "", "## Designs", "", *_designs(states), ""]
    lines += [f"Versions of the physics: {', '.join(f'{name} {number}' for name, number in PHYSICS.items())}.", ""]
    lines += [solved_at(state.commit for state in states if state.commit), ""]
    write_text(folder / "ACCURACY.md", "\n".join([*lines, made(command, origin)]) + "\n")


def _references(fineness: int) -> list[str]:
    scenes = (("press", "press"), ("stick and grip", "stick"), ("friction", "friction"), ("tangents", "modes"))
    return [f"- {name}: `{error_study_cases.reference(scene, fineness)}`" for name, scene in scenes]


def _left_out(states: Sequence[ErrorState]) -> list[str]:
    missing = sum(state.status == "not_run" for state in states)
    lines = [f"- {missing} states were not solved within the time limit (`--minutes`)."] if missing else []
    lines += [
        f"- design {state.design}, magnet {state.magnet}, {state.model} {state.path}, {state.level}, depth "
        f"{state.depth_mm:g} mm, shear {state.shear_mm:g} mm: {state.status}; {state.message}"
        for state in states
        if state.status not in ("ok", "not_run")
    ]
    return lines or ["None."]


def _designs(states: Sequence[ErrorState]) -> list[str]:
    names = ("D", "L", "nu", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    chosen = sorted({state.design for state in states})
    values = [{name: f"{getattr(error_study_cases.designs()[i], name):g}" for name in names} for i in chosen]
    return _markdown([{"design": i} | value for i, value in zip(chosen, values, strict=True)])


def _markdown(rows: Sequence[FlatRow]) -> list[str]:
    heads = list(rows[0]) if rows else []
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    return [*lines, *("| " + " | ".join(_cell(row[head]) for head in heads) + " |" for row in rows)]


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else ""
    return str(value)


def rules(states: Sequence[ErrorState]) -> list[FlatRow]:
    """Return the rows of fem/results/error_rules.csv, with c so wide that each covers COVERAGE of its states.

    Rows with states in the study get today's versions and the commits of their solves; the others stay.
    """
    shares: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    commits: dict[tuple[str, str, str], set[str]] = defaultdict(set)
    for state in error_statistics.ended_well(states):
        for judged in state.judged:
            if math.isfinite(judged.error):
                key = _rule_of(state, judged.quantity)
                shares[key].append(judged.error / judged.estimate)
                commits[key].add(state.commit)
    rows = []
    for row in table_rows():
        key = row["scene"], row["variant"], row["quantity"]
        if key in shares:
            needed = sorted(shares[key])[math.ceil(COVERAGE * len(shares[key])) - 1]
            c = float(row["c"]) if needed <= 1 else rounded_up(needed * float(row["c"]), 3)
            today: dict[str, int] = dict(PHYSICS.items())
            row |= {"c": f"{c:g}", "version": str(today[row["model"]]), "commit": " - ".join(sorted(commits[key]))}
        rows.append(row)
    return rows


def _rule_of(state: ErrorState, quantity: str) -> tuple[str, str, str]:
    """Return scene, magnet and quantity by which a state's rule is found, see `fem.results.error_estimate_rules`."""
    if state.model == "half":
        return "solid press" if state.scene == "press" else "solid", state.magnet, quantity
    return state.scene, state.magnet, "pressed frequency" if quantity == "frequency" and state.depth_mm else quantity


def picture(path: Path, states: Sequence[ErrorState]) -> None:
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


def _colour_key(state: ErrorState) -> str:
    """Return the key of a state's colour in COLOURS."""
    return "half" if state.model == "half" else state.scene


def _scatter(axis: Any, states: Sequence[ErrorState], name: str) -> None:
    from studies.output.table_plots import log_numbers

    for state in error_statistics.ended_well(states):
        for error, estimate in error_statistics.pairs_of([state], name):
            look = {"marker": MARKERS[state.level], "color": COLOURS[_colour_key(state)], "alpha": 0.55}
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
