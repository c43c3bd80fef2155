"""The ladder of formulas beside the vibration: what one mass on one spring says of the readings per N."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from analytic.oscillator import moving_mass, natural_frequency, receptance
from geometry.arrays import Array
from geometry.design import Design
from geometry.relaxation import Relaxation
from studies.mechanics import resonance_peaks
from studies.mechanics.resonance_peaks import BAND
from studies.output.records import FlatRow

Response = Callable[[Array], NDArray[np.complex128]]
"""Complex amplitude at frequencies (f,), Hz."""
Models = dict[str, tuple[float, Response]]
"""Natural frequency, Hz, and response of oscillators by their names."""


def oscillators(design: Design, motion: str, stiffness: float, relaxation: Relaxation) -> Models:
    """Return natural frequency, Hz, and response of each oscillator, by its name.

    Parameters
    ----------
    stiffness : of the state at rest along the motion, N/mm; above 0.
    """
    from fem.analyses.modes import spring_mass

    own = natural_frequency(stiffness, moving_mass(design))
    name, loss = _loss_at(own, relaxation)

    def prony(f: Array) -> NDArray[np.complex128]:
        return receptance(f, own, relaxation.complex_modulus(2 * np.pi * f) / relaxation.rest)

    chosen: Models = {
        name: (own, lambda f: receptance(f, own, 1 + 1j * loss)),
        "mass on a spring with the silicone's branches": (own, prony),
    }
    if motion == "x":  # the paper's formula is that of a column
        return chosen
    silicone, whole = spring_mass(design)
    return {
        "the paper's formula": (silicone, lambda f: receptance(f, silicone)),
        "the paper's formula with the magnet's mass": (whole, lambda f: receptance(f, whole)),
        **chosen,
    }


def _loss_at(frequency: float, relaxation: Relaxation) -> tuple[str, float]:
    """Return the name of the oscillator with a constant loss factor, and that factor: the silicone's at a frequency.

    Where the branches do not speak for the frequency, Hz, it is the factor at the nearest one for which they do.
    """
    low, high = relaxation.speaks_for_frequencies
    nearest = min(max(frequency, low), high)
    loss = float(relaxation.loss_factor(2 * np.pi * nearest))
    name = f"mass on a spring, loss factor {loss:.3g}"
    return name if nearest == frequency else f"{name} as at {nearest:.3g} Hz", loss


def rungs(
    motion: str,
    models: Models,
    finite_elements: Response,
    band: tuple[float, float],
) -> list[FlatRow]:
    """Return the rows of ladder.csv: the oscillators and the finite elements.

    natural_Hz : natural frequency without damping; None for the finite elements, which have many.
    peak_Hz, peak_gain, Q : the first resonance inside the band, over the lowest frequency; None without one.
    relative_at_600 : response at 600 Hz over that at the lowest frequency; None outside the band.
    accurate_to_Hz : frequency up to which it changes by less than ACCURATE; None if it does so in the whole band.
    """
    listed: Sequence[tuple[str, float | None, Response]] = [
        *((name, natural, response) for name, (natural, response) in models.items()),
        ("finite elements", None, finite_elements),
    ]
    return [_rung(motion, name, natural, response, band) for name, natural, response in listed]


def _rung(motion: str, name: str, natural: float | None, response: Response, band: tuple[float, float]) -> FlatRow:
    """Return the rung of one model."""
    low, high = band
    first = float(abs(response(np.array([low]))[0]))

    def gain(f: Array) -> Array:
        return np.abs(response(f)) / first

    # an undamped resonance has no height
    damped = bool(np.iscomplex(response(np.array([high]))).any())
    peak = next(iter(resonance_peaks.peaks(gain, low, high)), None) if damped else None
    return {
        "motion": motion,
        "model": name,
        "natural_Hz": natural,
        "peak_Hz": peak and peak.frequency,
        "peak_gain": peak and peak.gain,
        "Q": peak and peak.Q,
        "relative_at_600": float(gain(np.array([BAND]))[0]) if low <= BAND <= high else None,
        "accurate_to_Hz": resonance_peaks.flat_to(gain, resonance_peaks.ACCURATE, low, high),
    }
