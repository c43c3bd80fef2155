"""Relaxation of the silicone: Prony branches, the modulus over time and frequency, and the range they speak for.

Branches that were measured over seconds say nothing about 600 Hz: times and frequencies outside the covered range are
refused, or allowed on request and marked.

With the instantaneous shear modulus G0, branches (g_i, tau_i) and the share rest = 1 - sum g_i that never relaxes,

    G(t) / G0 = rest + sum g_i exp(-t / tau_i)                              after a step of the strain at t = 0,
    G*(w) / G0 = rest + sum g_i i w tau_i / (1 + i w tau_i) = G' + i G''    under a strain exp(i w t),

w = 2 pi f in rad/s. The loss factor is tan(delta) = G'' / G', positive: the stress leads the strain. Fast limit
(t -> 0, w -> inf): 1. Slow limit (t -> inf, w -> 0): rest. The bulk modulus does not relax. The long-term modulus
is rest times the instantaneous one; the field `modulus` of a design says which of the two its E is.

A design without measured branches (`prony`) has a loss factor that is constant in a band of frequencies. Its branches
follow from G'' - tan(delta) G' = 0 over the band, which is linear in h_i = g_i / rest >= 0: a problem of non-negative
least squares, of which every solution has sum g_i = sum h_i / (1 + sum h_i) < 1.
"""

import functools
import itertools
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.arrays import Array
from geometry.bad_input import BadInput

_NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
_BRANCH = re.compile(f"{_NUMBER}:{_NUMBER}")


class Silicone(Protocol):
    """The fields of `geometry.design.Design`, which imports this module, on which its relaxation depends."""

    @property
    def E(self) -> float: ...
    @property
    def temperature(self) -> float: ...
    @property
    def E_now(self) -> float: ...
    @property
    def modulus(self) -> str: ...
    @property
    def prony(self) -> str: ...
    @property
    def loss_factor(self) -> float: ...
    @property
    def loss_low(self) -> float: ...
    @property
    def loss_high(self) -> float: ...


@dataclass(frozen=True, slots=True)
class Relaxation:
    """Prony branches; without branches the silicone is elastic.

    Attributes
    ----------
    shares : g_i, share of each branch in the instantaneous modulus.
    times : tau_i, s.
    covered : shortest and longest time, s, for which the branches were measured or assumed; default: the shortest and
        the longest branch.

    Raises
    ------
    BadInput
        A share is negative, the shares add up to 1 or more, or a time is not positive.

    >>> Relaxation((0.2, 0.3), (0.1, 10.0)).modulus([0.0, 1e9]).tolist()
    [1.0, 0.5]
    """

    shares: tuple[float, ...]
    times: tuple[float, ...]
    covered: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        shortest, longest = 1e-12, 1e12  # beyond them, a time in s is taken for a mistake
        for g, tau in zip(self.shares, self.times, strict=True):
            if not 0 <= g < 1:
                raise BadInput(f"the share g of a branch must be at least 0 and less than 1; got {g:g}")
            if not shortest <= tau <= longest:
                raise BadInput(
                    f"the time tau of a branch must lie between {shortest:g} and {longest:g} s; got {tau:g} s"
                )
        if not sum(self.shares) < 1:
            raise BadInput(f"the shares g of all branches must add up to less than 1; got {sum(self.shares):g}")

    @property
    def rest(self) -> float:
        """Long-term over instantaneous modulus."""
        return 1.0 - math.fsum(self.shares)

    @property
    def speaks_for(self) -> tuple[float, float]:
        """Shortest and longest time, s, for which the branches hold; 0 and infinity without branches."""
        if self.covered is not None:
            return self.covered
        return (min(self.times), max(self.times)) if self.times else (0.0, math.inf)

    @property
    def speaks_for_frequencies(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz: 1 / (2 pi t) of the longest and of the shortest time."""
        short, long = self.speaks_for
        return 1 / (2 * math.pi * long), 1 / (2 * math.pi * short) if short > 0 else math.inf

    def modulus(self, t: ArrayLike) -> Array:
        """Return G(t) / G0 at times t >= 0 after a step, s; same shape as t."""
        t = np.asarray(t, dtype=float)
        return np.asarray(self.rest + np.exp(-t[..., None] / np.array(self.times)) @ np.array(self.shares))

    def complex_modulus(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Return G*(w) / G0 at angular frequencies, rad/s; same shape as omega."""
        storage, loss = branch_moduli(np.asarray(omega, dtype=float), np.array(self.times))
        return np.asarray(self.rest + (storage + 1j * loss) @ np.array(self.shares))

    def loss_factor(self, omega: ArrayLike) -> Array:
        """Return tan(delta) at angular frequencies, rad/s; same shape as omega."""
        g = self.complex_modulus(omega)
        return np.asarray(g.imag / g.real)


def branch_moduli(omega: Array, times: Array) -> tuple[Array, Array]:
    """Return storage and loss modulus of branches with g = 1, the shape of omega (rad/s) and that of times (s)."""
    x = omega[..., None] * times
    return x * x / (1 + x * x), x / (1 + x * x)


def parse_branches(text: str) -> Relaxation:
    """Return the branches in a text "g:tau g:tau ..." with tau in s, by rising tau.

    Two entries with g = 0 mark the shortest and the longest time that the measurement covers; without them it is
    taken to cover the times from the shortest to the longest branch.

    Raises
    ------
    BadInput
        The text has another form, lists a time twice, or its branches are impossible.

    >>> parse_branches("0.03:0.1 0.05:0.01 0:0.005 0:10")
    Relaxation(shares=(0.05, 0.03), times=(0.01, 0.1), covered=(0.005, 10.0))
    """
    pairs: list[tuple[float, float]] = []
    for word in text.split():
        match = _BRANCH.fullmatch(word)
        if not match:
            raise BadInput(f"prony must list branches g:tau with tau in s, such as 0.05:0.01 0.03:0.1; got '{word}'")
        pairs.append((float(match[2]), float(match[1])))
    pairs.sort()
    try:
        # the marks are checked too: their times must be possible
        Relaxation(tuple(g for _, g in pairs), tuple(tau for tau, _ in pairs))
    except BadInput as error:
        raise BadInput(f"prony: {error}") from None
    branches, marks = [pair for pair in pairs if pair[1]], [tau for tau, g in pairs if not g]
    for (tau, _), (next_tau, _) in itertools.pairwise(branches):
        if tau == next_tau:
            raise BadInput(f"prony lists the time tau = {tau:g} s twice: give one branch with the sum of both shares")
    if pairs and not branches:
        raise BadInput(
            "prony lists no branch with a share g above 0: leave it empty; loss_factor=0 makes an elastic silicone"
        )
    if marks and (len(marks) != 2 or marks[0] == marks[1]):
        raise BadInput("prony: entries with g = 0 mark the covered times, so give two, the shortest and the longest")
    covered = (marks[0], marks[1]) if marks else None
    return Relaxation(tuple(g for _, g in branches), tuple(tau for tau, _ in branches), covered)


def branches_text(relaxation: Relaxation) -> str:
    """Return branches as the field `prony` takes them; `parse_branches` is the inverse.

    >>> branches_text(parse_branches("0.050:0.01 0:10 0:0.1"))
    '0.05:0.01 0:0.1 0:10'
    """
    pairs = list(zip(relaxation.times, relaxation.shares, strict=True))
    pairs += [(tau, 0.0) for tau in relaxation.covered or ()]
    return " ".join(f"{g:.6g}:{tau:.6g}" for tau, g in sorted(pairs))


@functools.lru_cache(maxsize=1000)
def constant_loss(loss_factor: float, low: float, high: float) -> Relaxation:
    """Return branches whose loss factor is constant within 2 % over a band of frequencies.

    Parameters
    ----------
    loss_factor : tan(delta); 0 gives no branches.
    low, high : ends of the band, Hz.

    Raises
    ------
    BadInput
        The band is too wide, or nearly all stress would relax.
    """
    if not loss_factor > 0:
        return Relaxation((), ())
    # each decade adds branches, which every solve carries
    decades, most = math.log10(high / low), 10
    if not 0 < decades <= most:
        raise BadInput(
            f"the band of a constant loss factor must be above 0 and at most {most} decades wide; got "
            f"{low:g} to {high:g} Hz: change loss_low or loss_high"
        )
    from scipy.optimize import nnls

    # two branches a decade let the loss factor vary by about 0.1 %; half a decade beyond the band holds its ends
    count = math.ceil((decades + 1) * 2) + 1
    times = np.geomspace(10**0.5 / low, 10**-0.5 / high, count)[::-1] / (2 * math.pi)
    storage, loss = branch_moduli(2 * math.pi * np.geomspace(low, high, 40 * math.ceil(decades) + 1), times)
    scale = np.ones(len(loss))
    for _ in range(4):
        # the error of tan(delta) is that of G'' - tan(delta) G' over G', so the rows are weighed with the last G'
        h, _ = nnls((loss / loss_factor - storage) / scale[:, None], 1 / scale)
        scale = 1 + storage @ h
    rest = 1 / (1 + h.sum())
    error = float(np.max(np.abs(loss @ h / scale / loss_factor - 1)))
    # the instantaneous modulus of no silicone is more than 1e4 times the long-term one
    if not (error <= 0.02 and rest >= 1e-4):
        raise BadInput(
            f"a loss factor of {loss_factor:g} from {low:g} to {high:g} Hz leaves less than 0.0001 of the "
            f"instantaneous modulus in the long term: lower loss_factor or narrow the band loss_low to loss_high"
        )
    used = h > 0
    ends = (1 / (2 * math.pi * high), 1 / (2 * math.pi * low))
    return Relaxation(tuple((h[used] * rest).tolist()), tuple(times[used].tolist()), ends)


def relaxation_of(design: Silicone) -> Relaxation:
    """Return the branches of a design: `prony`, or those of its constant loss factor.

    >>> from geometry.design import Design
    >>> relaxation_of(Design(loss_factor=0.0))
    Relaxation(shares=(), times=(), covered=None)
    """
    if design.prony:
        return parse_branches(design.prony)
    return constant_loss(design.loss_factor, design.loss_low, design.loss_high)


def moduli(design: Silicone) -> tuple[float, float]:
    """Return the instantaneous and the long-term Young's modulus of a design at its temperature, MPa.

    The ratio of both is that of the shear moduli, exactly for nu = 0.5; the bulk does not relax.

    >>> from geometry.design import Design
    >>> moduli(Design(E=1.0, prony="0.5:1", modulus="instantaneous"))
    (1.0, 0.5)
    """
    E, rest = design.E_now, relaxation_of(design).rest
    return (E, E * rest) if design.modulus == "instantaneous" else (E / rest, E)


def lame(E: float, nu: float) -> tuple[float, float]:
    """Return the shear modulus and the inverse of the bulk modulus (0 for nu = 0.5).

    >>> lame(3.0, 0.5)
    (1.0, 0.0)
    """
    return E / (2 * (1 + nu)), 3 * (1 - 2 * nu) / E


def relaxation_notes(design: Silicone) -> list[str]:
    """Return sentences: which modulus E is, where the branches come from, and what is assumed.

    >>> from geometry.design import Design
    >>> relaxation_notes(Design(prony="0.5:1", modulus="long-term"))[0]
    'E = 1 MPa is the long-term modulus (the default); the instantaneous modulus is 2 MPa'
    """
    relaxation, (fast, slow) = relaxation_of(design), moduli(design)
    E = f"E = {design.E_now:g} MPa" + (f" at {design.temperature:g} C" if design.E_now != design.E else "")
    if not relaxation.times:
        return [f"the silicone is elastic (loss_factor is 0): {E} at every rate"]
    # a design file may state the default, so it is not called an assumption
    remark, second, value = (
        ("", "long-term", slow) if design.modulus == "instantaneous" else (" (the default)", "instantaneous", fast)
    )
    which = f"{E} is the {design.modulus} modulus{remark}; the {second} modulus is {value:.4g} MPa"
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
            (times, relaxation.speaks_for, "s"),
            (frequencies, relaxation.speaks_for_frequencies, "Hz"),
        )
        if (text := _outside(values, low, high))
    ]
    return f"the branches speak for {range_text(relaxation)}, not for {' and '.join(outside)}" if outside else ""


def range_remedy(design: Silicone) -> str:
    """Return what widens the range for which the branches of a design speak."""
    if not design.prony:
        return "change loss_low or loss_high"
    return "measure further, and mark the shortest and the longest time of the test in prony by entries 0:LOW 0:HIGH"


def range_text(relaxation: Relaxation) -> str:
    """Return the covered range in words, as times and as frequencies."""
    (short, long), (low, high) = relaxation.speaks_for, relaxation.speaks_for_frequencies
    return f"{_three(short)} to {_three(long)} s ({_three(low)} to {_three(high)} Hz)"


def _outside(values: Iterable[float], low: float, high: float) -> str:
    """Return the least and the largest value outside a range; its ends, in `prony`, have six digits."""
    beyond = [value for value in values if not low * (1 - 1e-5) <= value <= high * (1 + 1e-5)]
    if not beyond:
        return ""
    least, most = _three(min(beyond)), _three(max(beyond))
    return least if least == most else f"{least} to {most}"


def _three(value: float) -> str:
    """Return a number with three digits, 1000 rather than 1e+03."""
    return f"{float(f'{value:.3g}'):g}"


def check_range(
    design: Silicone, *, times: Iterable[float] = (), frequencies: Iterable[float] = (), beyond: bool = False
) -> list[str]:
    """Check that the branches of a design speak for times, s, and frequencies, Hz; return a warning if they do not.

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
