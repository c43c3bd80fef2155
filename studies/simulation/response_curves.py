"""Readings of a vibrating sensor over the frequency: volts per mm and per N of each Hall element.

The readings are linear in the magnet's small motion (`analytic.inverse.forward_model`); an element whose output lies
at a rail reads nothing.

The curves have estimated errors, from their differences to those on a coarser mesh. A gain g(f) of force over motion,
or of readings over force, is wrong for two reasons. Its size is wrong by a share e, as that of a static gain is. And
its resonances f_0 are wrong by e / 2, as f_0^2 goes with a stiffness. As g is a function of f / f_0, the relative
error is about

    A e,        A = 1 + |d ln g / d ln f| / 2.

e follows from a rule (`fem.results.error_estimates`) and from the difference to the coarser mesh over A.
`studies.validation.errors.vibration_check` compares the estimates with errors against much finer meshes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import Design
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from fem.analyses.vibration import VibratingSensor
    from fem.results.error_estimates import VibrationQuantity
    from fem.scene import Scene

Complex = NDArray[np.complex128]
NEGLIGIBLE = 1e-9
"""Reading of an element over the largest one of all elements below which symmetry forbids it: rounding errors."""


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Complex amplitudes under one motion of the plate, or of the base of the free sensor, over its amplitude.

    Attributes
    ----------
    motion : "z" or "x".
    frequency : (f,) Hz.
    force : (f,) force along the motion, N/mm; None about the free sensor.
    normal_force : (f,) amplitude of the force along z, N/mm; None where there is none, or where symmetry forbids it.
    shift : (f, 2) shift of the magnet along x and z, mm/mm.
    tilt : (f,) rad/mm.
    names, units : k elements, and the units of their outputs.
    per_mm, per_N : (f, k) readings over the motion and over the force along it; per_N is None without a force.
    kept_amplitude : (f,) mm, see `fem.analyses.vibration.Vibration`; None about the free sensor.
    """

    motion: str
    frequency: Array
    force: Complex | None
    normal_force: Array | None
    shift: Complex
    tilt: Complex
    names: tuple[str, ...]
    units: tuple[str, ...]
    per_mm: Complex
    per_N: Complex | None
    kept_amplitude: Array | None

    @property
    def along(self) -> Complex:
        """(f,) shift of the magnet along the motion, mm/mm."""
        return np.asarray(self.shift[:, ("x", "z").index(self.motion)])

    @property
    def compliance(self) -> Complex:
        """(f,) shift of the magnet along the motion over the force, mm/N."""
        assert self.force is not None
        return np.asarray(self.along / self.force)

    @property
    def readers(self) -> list[int]:
        """Elements whose readings symmetry and rails do not forbid, the largest reading first."""
        size = np.abs(self.per_mm).max(axis=0)
        order = np.argsort(-size, kind="stable")
        return [int(k) for k in order if size[k] > NEGLIGIBLE * size.max()]


At = Callable[[Array], dict[str, Curves]]
"""Curves of all motions at frequencies (f,), Hz."""


def evaluator(design: Design, sensor: VibratingSensor) -> At:
    """Return the function that gives the curves of a sensor at any frequencies in its band; it keeps its answers."""
    from analytic import hall
    from analytic.inverse.forward_model import slopes_at
    from analytic.parts import of_design

    layout, response = of_design(design), sensor.state.response
    by_shift, by_rotation = slopes_at(design, response.shift, response.rotation)
    saturated = np.array(hall.readings(design, response).saturated)
    gains = np.where(saturated, 0.0, [element.gain for element in layout])
    # x of the vibration is the direction (c, s) of the shear; a lean from z towards it is a rotation about (-s, c)
    c, s = sensor.scene.direction
    along, lean = by_shift[:, :2] @ [c, s], by_rotation[:, :2] @ [-s, c]
    slopes = gains * np.stack([along, by_shift[:, 2], lean])

    @functools.lru_cache(maxsize=200)
    def at_bytes(data: bytes) -> dict[str, Curves]:
        f = np.frombuffer(data)
        vibration = sensor.at(f)
        curves: dict[str, Curves] = {}
        for k, motion in enumerate(vibration.motions):
            force = vibration.force[:, k, ("x", "z").index(motion)]
            shift, tilt = vibration.shift[:, k], vibration.tilt[:, k]
            normal = np.abs(vibration.force[:, k, 1])
            per_mm = np.column_stack([shift, tilt]) @ slopes
            free = bool(np.isnan(force).any())
            curves[motion] = Curves(
                motion=motion,
                frequency=f,
                force=None if free else force,
                normal_force=normal if (normal > 0).all() else None,
                shift=shift,
                tilt=tilt,
                names=tuple(element.name for element in layout),
                units=tuple(element.unit for element in layout),
                per_mm=per_mm,
                per_N=None if free else per_mm / force[:, None],
                kept_amplitude=None if free else vibration.kept_amplitude[:, k],
            )
        return curves

    return lambda f: at_bytes(np.ascontiguousarray(f, dtype=np.float64).tobytes())


def mesh_difference(curves: Curves, coarse: Curves) -> Array:
    """Return the relative difference (f,) of the force to that on a coarser mesh; of the shift about the free sensor.

    Frequencies (f,) are those of the coarser mesh, which must be among those of the finer one.
    """
    one, other = (c.along if c.force is None else c.force for c in (curves, coarse))
    return _difference(one[np.isin(curves.frequency, coarse.frequency)], other)


def _difference(one: Complex, other: Complex) -> Array:
    # relative to the larger of both: a gain that falls to 0 beside a resonance would have no relative difference
    return np.asarray(np.abs(one - other) / np.maximum(np.abs(one), np.abs(other)))


def rows(curves: Curves, coarse: Curves | None, scene: Scene) -> list[FlatRow]:
    """Return the rows of response.csv: gains, phases and error estimates of all quantities over the frequency.

    Frequencies that the coarser mesh does not have, those of resonances, have no `mesh_difference`. Phases are those
    to the motion, or to the force for readings per N, in degrees.
    """
    columns: dict[str, Array | None] = {"frequency_Hz": curves.frequency}
    columns |= _polar("force", "_N_per_mm", curves.force)
    columns |= _polar("shift_x", "_mm_per_mm", curves.shift[:, 0]) | _polar(
        "shift_z", "_mm_per_mm", curves.shift[:, 1]
    )
    columns |= _polar("tilt", "_rad_per_mm", curves.tilt)
    for k, (name, unit) in enumerate(zip(curves.names, curves.units, strict=True)):
        columns |= _polar(name, f"_{unit}_per_mm", curves.per_mm[:, k] if k in curves.readers else None)
        per_N = None if curves.per_N is None or k not in curves.readers else curves.per_N[:, k]
        columns |= _polar(f"{name}_per_N", f"_{unit}_per_N", per_N)
    columns |= {"kept_amplitude_mm": curves.kept_amplitude, "mesh_difference": None}
    if coarse is not None:
        columns["mesh_difference"] = difference = np.full(len(curves.frequency), np.nan)
        difference[np.isin(curves.frequency, coarse.frequency)] = mesh_difference(curves, coarse)
    columns |= error_columns(curves, coarse, scene)
    return [
        {"motion": curves.motion}
        | {name: None if v is None or np.isnan(v[i]) else float(v[i]) for name, v in columns.items()}
        for i in range(len(curves.frequency))
    ]


def _polar(name: str, unit: str, values: Complex | None) -> dict[str, Array | None]:
    if values is None or not np.abs(values).max() > 0:
        return {f"{name.removesuffix('_per_N')}{unit}": None, f"{name}_phase_deg": None}
    return {
        f"{name.removesuffix('_per_N')}{unit}": np.abs(values),
        f"{name}_phase_deg": np.degrees(np.unwrap(np.angle(values))),
    }


# Estimated errors


def error_columns(curves: Curves, coarse: Curves | None, scene: Scene) -> dict[str, Array | None]:
    """Return the columns (f,) of response.csv with estimated relative errors; None without a coarser mesh."""
    found: dict[str, Array | None] = {"error_estimate": None, "reading_error_estimate": None}
    if coarse is None:
        return found
    # about the free sensor no reading has a force
    if curves.per_N is not None and coarse.per_N is not None and curves.readers:
        gains = [(curves.per_N[:, k], coarse.per_N[:, k]) for k in curves.readers]
        each = [errors("reading", curves, coarse, *pair, scene) for pair in gains]
        found["reading_error_estimate"] = np.asarray(np.max(each, axis=0))
    return found | {"error_estimate": force_errors(curves, coarse, scene)}


def force_errors(curves: Curves, coarse: Curves, scene: Scene) -> Array:
    """Return the relative errors (f,) of the force over the motion; of the shift, where the sensor is free."""
    if curves.force is None or coarse.force is None:
        return errors("base", curves, coarse, curves.along, coarse.along, scene)
    return errors("force", curves, coarse, curves.force, coarse.force, scene)


def errors(
    quantity: VibrationQuantity, curves: Curves, coarse: Curves, gain: Complex, coarse_gain: Complex, scene: Scene
) -> Array:
    """Return the relative errors (f,) of a gain (f,); that of the coarser mesh is at the frequencies of this mesh."""
    from fem.results.error_estimates import estimate_vibration

    f, slope = curves.frequency, amplification(curves.frequency, gain)
    both = np.isin(f, coarse.frequency)
    difference = np.interp(np.log(f), np.log(f[both]), _difference(gain[both], coarse_gain))
    return estimate_vibration(quantity, curves.motion, difference, slope, scene)


def amplification(f: Array, gain: Complex) -> Array:
    """Return A (f,) of the module's docstring for a gain at frequencies (f,), Hz, at least two.

    >>> f = np.array([99.0, 100.0, 101.0])
    >>> bool(np.isclose(amplification(f, f**2 + 0j)[1], 2, rtol=1e-3))
    True
    """
    logarithm = np.log(np.abs(gain)) + 1j * np.unwrap(np.angle(gain))
    return np.asarray(1 + np.abs(np.gradient(logarithm, np.log(f))) / 2)
