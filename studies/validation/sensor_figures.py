"""Figures of the claims that do not concern the beam's forces: readings, frequencies, Hall factor, and cost."""

from __future__ import annotations

import dataclasses
import functools
import math
import statistics
import time
from collections.abc import Callable, Sequence
from itertools import product
from typing import get_args

import numpy as np

from analytic import beam
from analytic.lookup import Grid
from analytic.magnet import cylinder_field
from analytic.relaxation_loops import loop
from fem import equilibrium
from fem.accuracy import QUICK, STANDARD, Accuracy
from fem.analyses.modes import modes, spring_mass
from geometry.design import Design, paper
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from geometry.relaxation import relaxation_of
from studies.mechanics import loading_cycles
from studies.mechanics.cycle_motion import Motion
from studies.sensing import layout_uniqueness
from studies.simulation import vibration_report
from studies.validation.claim_errors import S1_AT_REST, with_magnet
from studies.validation.pages import Row

FACTOR = 6.463e5
"""The paper's conversion factor of a Hall element, V/Wb (section V.A)."""
MU0 = 4e-7 * math.pi
"""Permeability of air in the paper's Table II; with its magnetisation M = 1 it is also the polarisation mu0 M, T."""
WORKSPACE, STEP = (3.0, 3.0), 0.01
"""Half width and depth of the paper's look-up table, and its step, mm."""
CYCLE_DEPTH, CYCLE_SPEED = 1.0, 0.5
"""Depth of the press, mm, and speed of the plate, mm/s, of a loading cycle; the paper gives no speed."""
VIBRATION_DEPTH, VIBRATION_BAND = 1.0, (1.0, 1000.0)
"""Depth of the press under a plate that sticks, mm, and the frequencies of its vibration, Hz."""
COST_DEPTHS = (0.5, 1.0, 2.0, 3.0)
"""Depths of the presses whose forces tell the errors of the models that are timed, mm."""


def _quiet(share: float, text: str) -> None:
    """Tell no progress."""


def layout_rows(layouts: Sequence[tuple[float, float]], progress: Progress) -> list[Row]:
    """Return the share of poses whose readings another pose gives too, for each layout and form of the readings.

    A layout is a height of the magnet, and a height c of S2 and S3, mm; l0 follows from what S1 reads at rest.
    """
    rows = []
    for k, ((height, c), form) in enumerate(product(layouts, layout_uniqueness.FORMS)):
        progress(
            k / len(layouts) / len(layout_uniqueness.FORMS), f"readings of a magnet {height:g} mm high, c = {c:g} mm"
        )
        design = dataclasses.replace(with_magnet(height), c=c)
        figures = layout_uniqueness.alike_figures(design, form)
        place = {"magnet_height_mm": height, "l0_mm": design.l0, "c_mm": c, "readings": form}
        rows.append(place | {"ambiguous_percent": figures["alike_percent"], "apart_mm": figures["alike_apart_mm"]})
    return rows


def table_entries() -> int:
    """Return the number of entries of the paper's look-up table.

    >>> table_entries()
    108721501
    """
    return math.prod(Grid(*WORKSPACE, STEP).shape)


def loop_figures() -> Row:
    """Return the gap at mid-stroke over full scale of a slow loading cycle, percent, with the preset's loss factor.

    It is that of the second cycle of a press by viscoelastic finite elements at level quick, and that of the steady
    cycle of a viscoelastic spring, of a triangle and of a sine.
    """
    design = paper()
    motion = Motion(CYCLE_DEPTH, 0.0, "none", CYCLE_SPEED / (2 * CYCLE_DEPTH), cycles=2)
    static = loading_cycles.Static(None, None)
    cycles = loading_cycles.run(design, motion, "prony", static, "quick", "rigid", 1e-3, _quiet)
    relaxation = relaxation_of(design)
    spring, sine = (loop(relaxation, motion.frequency, form).hysteresis for form in ("triangle", "sine"))
    found = {"loss_factor": design.loss_factor, "fem_percent": cycles.loops[-1]["gap_percent"]}
    return found | {"spring_percent": 100 * spring, "sine_percent": 100 * sine}


def mode_rows(accuracy: Accuracy, progress: Progress) -> list[Row]:
    """Return the frequencies of the paper's sensor, free and pressed by 1 mm, with and without the magnet."""
    rows, magnets = [], get_args(Magnet)
    for k, (depth, magnet) in enumerate(product((0.0, 1.0), magnets)):
        progress(k / 4, "frequencies")
        result = modes(paper(), magnet, 6, depth=depth, accuracy=accuracy)
        first = {f"{name}_Hz": result.frequency[result.shape.index(name)] for name in ("bending", "axial")}
        rows.append({"magnet": magnet, "depth_mm": depth, **first})
    return rows


def formula_frequencies() -> dict[str, float]:
    """Return frequencies of a mass on an axial spring EA/L, Hz, by three readings of the mass."""
    light, heavy = spring_mass(paper())
    # all of the silicone as a free mass, in place of a third of it as in Rayleigh's rod
    return {"third_of_silicone": light, "with_magnet": heavy, "all_silicone": light / math.sqrt(3)}


def response_figures(accuracy: Accuracy) -> Row:
    """Return what `magtip response` says of the paper's sensor with the loss factor of the preset.

    along_z and along_x are readings per N at 600 Hz over those at 1 Hz: of S1 by a force along z, of S2 by one along
    x. The resonance is that of the magnet under a force along x, None if there is none. Up to accurate_Hz both change
    by less than 5 %.
    """
    design, load = paper(), Load(VIBRATION_DEPTH, friction="stick")
    result = vibration_report.run(design, load, VIBRATION_BAND, 2, "rigid", accuracy.name, [], _quiet)
    z, x = (next(one for one in result.records if one["motion"] == axis) for axis in "zx")
    read = [(z, z["element"].index("S1")), (x, x["element"].index("S2"))]
    gains = [motion["relative_reading_at_600"][k] or math.nan for motion, k in read]
    flat = [motion["accurate_per_N_Hz"][k] for motion, k in read]
    return {
        "loss_factor": design.loss_factor,
        "along_z": gains[0],
        "along_x": gains[1],
        "resonance_Hz": next(iter(x["resonance_per_N_Hz"]), None),
        "Q": next(iter(x["resonance_per_N_Q"]), None),
        "accurate_Hz": min((one for one in flat if one is not None), default=VIBRATION_BAND[1]),
    }


def factor_figures() -> Row:
    """Return what the paper's factor and its magnetisation M = 1 imply.

    rest_mT is the flux density at S1 that 2.87 V mean for an SS495A, polarisation_T that of a magnet whose field
    gives an SS495A the voltages of the factor. rest_V and face_V are the change of S1's voltage by the factor at the
    preset's distance, and if S1 touched the magnet's face; pairs are heights of the magnet and distances l0 that give
    2.87 V for J = 1.2 T, mm.
    """
    design = paper()

    def by_factor(distance: float) -> float:
        point = np.array([[0.0, 0.0, distance]])
        return FACTOR * float(cylinder_field(point, design.magnet_diameter / 2, design.magnet_height, MU0)[0, 2])

    return {
        "rest_mT": 1e3 * (S1_AT_REST - design.hall_null) / design.hall_gain,
        "polarisation_T": FACTOR * MU0 / design.hall_gain,
        "rest_V": by_factor(design.l0),
        "face_V": by_factor(design.magnet_height / 2),
        "pairs": [(height, with_magnet(height).l0) for height in (1.0, 2.0, 3.0, 4.0)],
    }


def cost_rows(reference: Accuracy, progress: Progress) -> list[Row]:
    """Measure the formulas and two levels of the finite elements, without error estimates, on this machine.

    A row has the median CPU time of a press to 1 mm, and the error of the force at COST_DEPTHS that is largest in
    magnitude, %, against forces at an accuracy `reference`.
    """
    design, loads = paper(), [Load(depth) for depth in COST_DEPTHS]
    progress(0.0, "cost of the models")
    exact = _forces(design, loads, reference)
    rows: list[Row] = []

    def add(model: str, seconds: float, forces: list[float]) -> None:
        worst = max((100 * (force / true - 1) for force, true in zip(forces, exact, strict=True)), key=abs)
        rows.append({"model": model, "seconds": seconds, "worst_error_percent": worst})

    for level in beam.LEVELS:
        forces = [beam.solve(design, load, level).force[2] for load in loads]
        seconds = _cpu(functools.partial(beam.solve, design, Load(1.0), level), calls=200)
        add(f"formulas, level {level}", seconds, forces)
    for accuracy in (QUICK, STANDARD):
        progress(0.5, f"cost of the finite elements, level {accuracy.name}")
        forces = _forces(design, loads, accuracy)
        seconds = _cpu(functools.partial(_forces, design, [Load(1.0)], accuracy), calls=1)
        add(f"finite elements, level {accuracy.name}", seconds, forces)
    return rows


def _forces(design: Design, loads: list[Load], accuracy: Accuracy) -> list[float]:
    return [state.response.force[2] for state in equilibrium.trace(design, loads, accuracy, estimate=False)]


def _cpu(call: Callable[[], object], calls: int) -> float:
    """Return the median CPU time of one call, s, from three measurements of some calls each."""
    times = []
    for _ in range(3):
        begin = time.process_time()
        for _ in range(calls):
            call()
        times.append((time.process_time() - begin) / calls)
    return statistics.median(times)
