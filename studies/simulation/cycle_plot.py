"""The picture of loading cycles: force over the motion, cycle by cycle, and force over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from studies.output.table_plots import ANALYTIC, COLOURS, canvas, label
from studies.simulation.cycle_loops import CycleState
from studies.simulation.cycle_motion import Motion


def draw(path: str | Path, motion: Motion, states: Sequence[CycleState]) -> None:
    """Draw the loops of each cycle, and force and decoded force over time."""
    axis, along = (0, "shear") if motion.shear else (2, "depth")
    with canvas(path, 2, 1, shared=False) as (_, axes):
        for cycle in range(1, motion.cycles + 1):
            own = [one for one in states if one.stop.cycle == cycle]
            # a cycle begins at the last state before it, the first press at rest
            own = [*[one for one in states if one.stop.cycle < cycle][-1:], *own]
            way = [one.state.load.shear_x if motion.shear else one.state.load.depth for one in own]
            force = [one.state.response.force[axis] for one in own]
            if cycle == 1 and not motion.shear:
                way, force = [0.0, *way], [0.0, *force]
            axes[0].plot(way, force, color=COLOURS[(cycle - 1) % len(COLOURS)], label=f"cycle {cycle}")
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
