"""The picture of loading cycles: force over the motion, cycle by cycle, and force over time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies.output.table_plots import ANALYTIC, COLOURS, FEM, canvas, label
from studies.simulation.cycle_motion import Motion
from studies.simulation.cycle_report import CycleState

ARROW = (0.55, 0.65)
"""Ends of the arrows on a loop, as shares of the stroke."""


def draw(path: str | Path, motion: Motion, states: Sequence[CycleState], other: Sequence[CycleState] = ()) -> None:
    """Draw the loops of each cycle, with the last one by another law, and force and decoded force over time."""
    axis, along = (0, "shear") if motion.shear else (2, "depth")
    with canvas(path, 2, 1, shared=False) as (_, axes):
        for cycle in range(1, motion.cycles + 1):
            way, force = _loop(motion, states, cycle)
            axes[0].plot(way, force, color=COLOURS[(cycle - 1) % len(COLOURS)], label=f"cycle {cycle}")
        if other:
            text = f"cycle {motion.cycles}, law for large rates"
            axes[0].plot(*_loop(motion, other, motion.cycles), "--", color="black", linewidth=1, label=text)
        _mark_ways(axes[0], motion, states)
        along_force = "force along the shear (N)" if motion.shear else "press force (N)"
        label(axes[0], "a", along_force)
        axes[0].set_xlabel(f"{along} (mm)")
        if motion.cycles <= len(COLOURS):
            axes[0].legend(frameon=False, loc="upper left")
        times = [one.state.time for one in states]
        axes[1].plot(times, [one.state.response.force[axis] for one in states], color=FEM, label="of the plate")
        decoded = [one.decoded for one in states]
        if not all(map(math.isnan, decoded)):
            axes[1].plot(times, decoded, "--", color=ANALYTIC, label="decoded from the readings, as if loaded slowly")
        label(axes[1], "b", along_force)
        axes[1].set_xlabel("time (s)")
        # above the axes: the curves fill them
        axes[1].legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)


def _mark_ways(axis: Any, motion: Motion, states: Sequence[CycleState]) -> None:
    """Mark both ways of the last cycle with arrows and their names."""
    colour = COLOURS[(motion.cycles - 1) % len(COLOURS)]
    names = ("to +x", "to \N{MINUS SIGN}x") if motion.shear else ("loading", "unloading")
    way, force = _loop(motion, states, motion.cycles)
    least, most = min(way), max(way)
    for rising, name in zip((True, False), names, strict=True):
        ends = [least + share * (most - least) for share in (ARROW if rising else ARROW[::-1])]
        points = [_crossing(way, force, end, rising=rising) for end in ends]
        if any(math.isnan(y) for y in points):
            continue  # a cycle that was not finished
        (x0, x1), (y0, y1) = ends, points
        axis.annotate("", (x1, y1), (x0, y0), arrowprops={"arrowstyle": "-|>", "color": colour, "mutation_scale": 18})
        beside = {"ha": "right", "va": "bottom"} if rising else {"ha": "left", "va": "top"}
        away = (-6, 4) if rising else (6, -4)
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        axis.annotate(name, middle, away, textcoords="offset points", fontsize=11, color=colour, **beside)


def _crossing(way: Sequence[float], force: Sequence[float], at: float, *, rising: bool) -> float:
    """Return the force where the motion passes a place on its way up or down; NaN if it does not."""
    for (x0, x1), (y0, y1) in zip(itertools.pairwise(way), itertools.pairwise(force), strict=True):
        if x0 != x1 and (x1 > x0) == rising and min(x0, x1) <= at <= max(x0, x1):
            return y0 + (y1 - y0) * (at - x0) / (x1 - x0)
    return math.nan


def _loop(motion: Motion, states: Sequence[CycleState], cycle: int) -> tuple[list[float], list[float]]:
    """Return motion and force of a cycle, which begins at the last state before it, the first press at rest."""
    own = [one.state for one in states if one.stop.cycle == cycle]
    own = [*[one.state for one in states if one.stop.cycle < cycle][-1:], *own]
    axis = 0 if motion.shear else 2
    way = [one.load.shear_x if motion.shear else one.load.depth for one in own]
    force = [one.response.force[axis] for one in own]
    return ([0.0, *way], [0.0, *force]) if cycle == 1 and not motion.shear else (way, force)
