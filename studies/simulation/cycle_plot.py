"""The picture of loading cycles: force over the motion, cycle by cycle, and force over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from studies.output.table_plots import ANALYTIC, COLOURS, canvas, label
from studies.simulation.cycle_loops import CycleState
from studies.simulation.cycle_motion import Motion


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
        label(axes[0], "a", "force (N)")
        axes[0].set_xlabel(f"{along} (mm)")
        if motion.cycles <= len(COLOURS):
            axes[0].legend(frameon=False)
        times = [one.state.time for one in states]
        axes[1].plot(times, [one.state.response.force[axis] for one in states], label="force")
        axes[1].plot(times, [one.decoded for one in states], "--", color=ANALYTIC, label="decoded")
        label(axes[1], "b", "force (N)")
        axes[1].set_xlabel("time (s)")
        # above the axes: the curves fill them
        axes[1].legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0)


def _loop(motion: Motion, states: Sequence[CycleState], cycle: int) -> tuple[list[float], list[float]]:
    """Return motion and force of a cycle, which begins at the last state before it, the first press at rest."""
    own = [one.state for one in states if one.stop.cycle == cycle]
    own = [*[one.state for one in states if one.stop.cycle < cycle][-1:], *own]
    axis = 0 if motion.shear else 2
    way = [one.load.shear_x if motion.shear else one.load.depth for one in own]
    force = [one.response.force[axis] for one in own]
    return ([0.0, *way], [0.0, *force]) if cycle == 1 and not motion.shear else (way, force)
