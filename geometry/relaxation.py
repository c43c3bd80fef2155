"""The relaxation of a design: its branches, its two moduli, and the times and frequencies for which they speak.

`geometry.prony` has the equations. Branches that were measured over seconds say nothing about 600 Hz: times and
frequencies outside the covered range are refused, or allowed on request and marked.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from geometry.design import BadInput, Design
from geometry.prony import Relaxation as Relaxation
from geometry.prony import branches_of
from geometry.prony import constant_loss as constant_loss
from geometry.prony import parse_branches as parse_branches

ROUNDING = 1e-5
"""Relative difference that is rounding: the field `prony` has times to six digits."""


def relaxation_of(design: Design) -> Relaxation:
    """Return the branches of a design: `prony`, or those of its constant loss factor.

    >>> relaxation_of(Design(loss_factor=0.0))
    Relaxation(shares=(), times=(), covered=None)
    """
    return branches_of(design.prony, design.loss_factor, design.loss_low, design.loss_high)


def moduli(design: Design) -> tuple[float, float]:
    """Return the instantaneous and the long-term Young's modulus of a design at small strain, MPa.

    The ratio of both is that of the shear moduli, exactly for nu = 0.5; the bulk does not relax.

    >>> moduli(Design(E=1.0, prony="0.5:1", modulus="instantaneous"))
    (1.0, 0.5)
    """
    rest = relaxation_of(design).rest
    return (design.E, design.E * rest) if design.modulus == "instantaneous" else (design.E / rest, design.E)


def relaxation_notes(design: Design) -> list[str]:
    """Return sentences: which modulus E is, where the branches come from, and what is assumed.

    >>> relaxation_notes(Design(prony="0.5:1", modulus="long-term"))[0]
    'E = 1 MPa is the long-term modulus (the default); the instantaneous modulus is 2 MPa'
    """
    relaxation, (fast, slow) = relaxation_of(design), moduli(design)
    if not relaxation.times:
        return [f"the silicone is elastic (loss_factor is 0): E = {design.E:g} MPa at every rate"]
    instantaneous = design.modulus == "instantaneous"
    other = (
        f"the {'long-term' if instantaneous else 'instantaneous'} modulus is {slow if instantaneous else fast:.4g}"
    )
    # a design file may state the default, so it is not called an assumption
    default = "" if instantaneous else " (the default)"
    which = f"E = {design.E:g} MPa is the {design.modulus} modulus{default}; {other} MPa"
    count = f"{len(relaxation.times)} Prony branch{'es' if len(relaxation.times) > 1 else ''}"
    if design.prony:
        return [which, f"{count} from the field prony, which speak for {range_text(relaxation)}"]
    source = (
        f"{count} of a constant loss factor of {design.loss_factor:g} from {design.loss_low:g} to "
        f"{design.loss_high:g} Hz, which is an assumption, not a measurement: magtip fit turns tests into branches"
    )
    return [which, source]


def range_sentence(relaxation: Relaxation, *, times: Iterable[float] = (), frequencies: Iterable[float] = ()) -> str:
    """Return the sentence that refuses times, s, or frequencies, Hz, outside the covered range; "" if all are inside.

    >>> range_sentence(Relaxation((0.5,), (1.0,), (0.1, 10.0)), frequencies=[1.0, 600.0])
    'the branches speak for 0.1 to 10 s (0.0159 to 1.59 Hz), not for 600 Hz'
    """
    outside = [
        f"{text} {unit}"
        for values, (low, high), unit in (
            (list(times), relaxation.speaks_for, "s"),
            (list(frequencies), relaxation.speaks_for_frequencies, "Hz"),
        )
        if (text := _outside(values, low, high))
    ]
    return f"the branches speak for {range_text(relaxation)}, not for {' and '.join(outside)}" if outside else ""


def range_remedy(design: Design) -> str:
    """Return what widens the range for which the branches of a design speak."""
    if not design.prony:
        return "change loss_low or loss_high"
    return "measure further, and mark the shortest and the longest time of the test in prony by entries 0:LOW 0:HIGH"


def range_text(relaxation: Relaxation) -> str:
    """Return the covered range in words, as times and as frequencies."""
    (short, long), (low, high) = relaxation.speaks_for, relaxation.speaks_for_frequencies
    return f"{_three(short)} to {_three(long)} s ({_three(low)} to {_three(high)} Hz)"


def _outside(values: Sequence[float], low: float, high: float) -> str:
    """Return the least and the largest value outside a range; the ends of the range may differ by rounding."""
    beyond = [value for value in values if not low * (1 - ROUNDING) <= value <= high * (1 + ROUNDING)]
    if not beyond:
        return ""
    least, most = _three(min(beyond)), _three(max(beyond))
    return least if least == most else f"{least} to {most}"


def _three(value: float) -> str:
    """Return a number with three digits, without a power of ten where it is not very small or large.

    >>> _three(1000.0), _three(1.5915)
    ('1000', '1.59')
    """
    return f"{float(f'{value:.3g}'):g}"


def check_range(
    design: Design, *, times: Iterable[float] = (), frequencies: Iterable[float] = (), beyond: bool = False
) -> list[str]:
    """Check that the branches of a design speak for times, s, and frequencies, Hz; return a warning if they do not.

    Parameters
    ----------
    beyond : whether values outside the range are allowed, and only marked by the warning.

    Raises
    ------
    BadInput
        A value is outside the range, and `beyond` is False.
    """
    sentence = range_sentence(relaxation_of(design), times=times, frequencies=frequencies)
    if sentence and not beyond:
        raise BadInput(
            f"{sentence}: {range_remedy(design)}, or allow such values (extrapolate), which marks the results"
        )
    return [f"{sentence}: the results are an extrapolation"] if sentence else []
