"""Estimated errors of a vibration, from the differences of its curves to those on a coarser mesh.

A gain g(f) of force over motion, or of readings over force, is wrong for two reasons. Its size is wrong by a share e,
as that of a static gain is. And its resonances f_0 are wrong by e / 2, as f_0^2 goes with a stiffness. As g is a
function of f / f_0, the relative error is about

    A e,        A = 1 + |d ln g / d ln f| / 2.

e follows from a rule (`fem.results.error_estimate_rules`) and from the difference to the coarser mesh over A.
`studies.validation.vibration_errors` compares the estimates with errors against much finer meshes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from studies.simulation.response_curves import Complex, Curves

if TYPE_CHECKING:
    from fem.results.error_estimate_rules import VibrationQuantity
    from fem.scene import Scene


def columns(curves: Curves, coarse: Curves | None, scene: Scene) -> dict[str, Array | None]:
    """Return the columns (f,) of response.csv with estimated relative errors; None without a coarser mesh."""
    if coarse is None:
        return {"error_estimate": None, "reading_error_estimate": None}
    return {
        "error_estimate": force_errors(curves, coarse, scene),
        "reading_error_estimate": reading_errors(curves, coarse, scene),
    }


def force_errors(curves: Curves, coarse: Curves, scene: Scene) -> Array:
    """Return the relative errors (f,) of the force over the motion; of the shift, where the sensor is free."""
    if curves.force is None or coarse.force is None:
        return errors("base", curves, coarse, curves.along, coarse.along, scene)
    return errors("force", curves, coarse, curves.force, coarse.force, scene)


def reading_errors(curves: Curves, coarse: Curves, scene: Scene) -> Array | None:
    """Return the relative errors (f,) of the readings over the force, the largest of all elements that read anything.

    None about the free sensor, and where no element reads anything.
    """
    if curves.per_N is None or coarse.per_N is None or not curves.readers:
        return None
    each = [errors("reading", curves, coarse, curves.per_N[:, k], coarse.per_N[:, k], scene) for k in curves.readers]
    return np.asarray(np.max(each, axis=0))


def errors(
    quantity: VibrationQuantity, curves: Curves, coarse: Curves, gain: Complex, coarse_gain: Complex, scene: Scene
) -> Array:
    """Return the relative errors (f,) of a gain (f,), whose values on the coarser mesh are those of its frequencies.

    Frequencies of the coarser mesh must be among those of the finer one, which may have more.
    """
    from fem.results.error_estimates import estimate_vibration

    f, slope = curves.frequency, amplification(curves.frequency, gain)
    both = np.isin(f, coarse.frequency)
    one = gain[both]
    # relative to the larger of both: a gain that falls to 0 beside a resonance would have no relative difference
    difference = np.abs(one - coarse_gain) / np.maximum(np.abs(one), np.abs(coarse_gain))
    difference = np.interp(np.log(f), np.log(f[both]), difference)
    return estimate_vibration(quantity, curves.motion, difference, slope, scene)


def amplification(f: Array, gain: Complex) -> Array:
    """Return A (f,) of the module's docstring for a gain at frequencies (f,), Hz, at least two.

    >>> f = np.array([99.0, 100.0, 101.0])
    >>> bool(np.isclose(amplification(f, f**2 + 0j)[1], 2, rtol=1e-3))
    True
    """
    logarithm = np.log(np.abs(gain)) + 1j * np.unwrap(np.angle(gain))
    return np.asarray(1 + np.abs(np.gradient(logarithm, np.log(f))) / 2)
