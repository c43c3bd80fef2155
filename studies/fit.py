"""From a uniaxial test to the silicone's law: fits of every law, their ranking, and where each is stable.

The specimen is incompressible with free sides, which gives the nominal stress in closed form. All points weigh the
same in nominal stress. Laws are ranked by Akaike's corrected criterion for n points and k parameters, the noise's
size among them,

    AICc = n ln(SSE / n) + 2 k + 2 k (k + 1) / (n - k - 1),

which takes errors as independent: a slow drift of the machine makes the larger laws look better than they are.
Residuals of less than 1e-9 of the largest stress count as none, and n <= k + 1 ranks last. So do laws with a number
at a bound of the search: the criterion does not hold there, for the best fit lies beyond or a number is undetermined.

A law is called stable at a homogeneous stretch if, the body being incompressible and its free directions without
stress, it is so in Drucker's sense (`fem.drucker`), and dP : dF > 0 along the mode itself, so that the nominal stress
still rises.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem import drucker
from fem.material import law
from geometry.design import LAWS, LEAST_ALPHA, BadInput, Design
from studies.files import write_text
from studies.specimen import Specimen, read

Array = NDArray[np.float64]

FILES = ("fit.csv", "fit.png", "design.toml")
"""What is written into a folder."""

MARK = "# fitted to "
"""How a design file begins that is written here."""

EXACT = 1e-9
"""Residual over the largest stress that counts as rounding."""

STARTS: dict[str, list[tuple[float, ...]]] = {
    "neo-hookean": [()],
    "mooney-rivlin": [(0.5,), (0.1,), (0.9,)],
    "yeoh": [(0.0, 0.0), (0.1, 0.01), (-0.1, 0.01)],
    "ogden": [
        (2.5, -2.5, 0.5),
        (1.5, 5.0, 0.1),
        (8.0, -2.0, 0.5),
        (3.0, 1.0, 0.5),
        (12.0, 2.0, 0.9),
        (4.0, -8.0, 0.3),
    ],
}
MODES = {"uniaxial": (1.0, -0.5, -0.5), "equibiaxial": (0.5, 0.5, -1.0), "planar": (1.0, 0.0, -1.0)}
"""Logarithmic strains of each mode over their measure; the last direction is free of stress."""

AT_BOUND = 1e-6
"""Distance of a number from its bound, over its range, that counts as none."""

RANGE = (0.3, 4.0)
"""Stretches between which stability is looked for."""


@dataclass(frozen=True, slots=True)
class Fit:
    """One law fitted to a test.

    Attributes
    ----------
    numbers : of `geometry.design.LAWS`.
    rms : root mean square of the residual, MPa; `share` is that over the largest stress.
    stable : least and largest stretch of each of `MODES` between which the law is stable, 1 among them.
    everywhere : whether it is stable in all of `RANGE` and of the data.
    bounded : names of the numbers that ended at a bound of the search.
    warning : if the data themselves leave the stable range, or a number is bounded.
    """

    law: str
    E: float
    numbers: dict[str, float]
    rms: float
    share: float
    aicc: float
    stable: dict[str, tuple[float, float]]
    everywhere: bool
    bounded: tuple[str, ...]
    warning: str


def nominal_stress(name: str, numbers: tuple[float, ...], stretch: Array) -> Array:
    """Nominal stress over mu of an incompressible bar, shape of `stretch`.

    >>> float(nominal_stress("neo-hookean", (), np.array(2.0)))
    1.75
    """
    if name == "ogden":
        a1, a2, share = numbers
        return (1 - share) * _ogden_term(a1, stretch) + share * _ogden_term(a2, stretch)
    x = stretch**2 + 2 / stretch - 3
    slope = np.ones_like(stretch)
    if name == "mooney-rivlin":
        slope = 1 - numbers[0] + numbers[0] / stretch
    elif name == "yeoh":
        slope = 1 + 2 * numbers[0] * x + 3 * numbers[1] * x**2
    return np.asarray(slope * (stretch - stretch**-2))


def _ogden_term(alpha: float, stretch: Array) -> Array:
    """2 / alpha (l^(alpha - 1) - l^(-alpha / 2 - 1)), also near alpha = 0."""
    h = np.log(stretch)
    if abs(alpha) < 1e-8:
        return np.asarray(3 * h / stretch)
    return np.asarray(4 / alpha * np.exp(alpha * h / 4) * np.sinh(0.75 * alpha * h) / stretch)


def fit(data: Specimen, nu: float = 0.4998) -> list[Fit]:
    """Every law fitted, the best first.

    Raises
    ------
    BadInput
        nu is not that of a nearly incompressible body, or the stress falls where the stretch grows.
    """
    if not 0.49 <= nu <= 0.5:
        raise BadInput(
            f"--nu must lie between 0.49 and 0.5, as a fit takes the specimen as incompressible; got {nu:g}"
        )
    unit = nominal_stress("neo-hookean", (), data.stretch)
    mu = float(unit @ data.stress) / float(unit @ unit)
    if not mu > 0:
        raise BadInput("the stress falls where the stretch grows: tension must be positive in both columns")
    return sorted((_fitted(name, data, mu, nu) for name in LAWS), key=lambda f: (bool(f.bounded), f.aicc))


def _fitted(name: str, data: Specimen, mu: float, nu: float) -> Fit:
    """One law's least squares from several starts; `mu` is the neo-Hookean shear modulus, the scale of the search."""
    from scipy.optimize import least_squares

    largest = float(np.abs(data.stress).max())
    specs = {spec: Design.__dataclass_fields__[spec].metadata for spec in LAWS[name]}
    low = [1e-3, *(spec["low"] for spec in specs.values())]
    high = [1e3, *(spec["high"] for spec in specs.values())]

    def residual(x: Array) -> Array:
        model = x[0] * mu * nominal_stress(name, tuple(x[1:]), data.stretch)
        return np.asarray((model - data.stress) / largest)

    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 300}
    tries = [
        least_squares(
            residual, (1.0, *start), bounds=(low, high), jac="3-point", method="dogbox", x_scale="jac", **tight
        )
        for start in STARTS[name]
    ]
    best = min(tries, key=lambda found: found.cost).x
    numbers = dict(zip(LAWS[name], _tidy(name, best[1:].tolist()), strict=True))
    values = tuple(numbers.values())
    rms = largest * math.sqrt(float(np.mean(residual(np.array([best[0], *values])) ** 2)))
    stable = stable_ranges(name, values, (float(data.stretch.min()), float(data.stretch.max())))
    low_stretch, high_stretch = stable["uniaxial"]
    bounded = tuple(
        name for name, value in numbers.items() if _at_bound(value, specs[name]["low"], specs[name]["high"])
    )
    warning = ""
    if not (low_stretch <= data.stretch.min() and data.stretch.max() <= high_stretch):
        warning = f"the data leave the stable range of {name}, stretch {low_stretch:.3g} to {high_stretch:.3g}"
    return Fit(
        law=name,
        E=2 * (1 + nu) * float(best[0]) * mu,
        numbers=numbers,
        rms=rms,
        share=rms / largest,
        aicc=aicc(len(data.stress), len(best) + 1, max(rms / largest, EXACT)),
        stable=stable,
        everywhere=all(low <= RANGE[0] and high >= RANGE[1] for low, high in stable.values()) and not warning,
        bounded=bounded,
        warning="; ".join(filter(None, (warning, _said_of(bounded, numbers)))),
    )


def _at_bound(value: float, low: float, high: float) -> bool:
    return min(value - low, high - value) <= AT_BOUND * (high - low)


def _said_of(bounded: tuple[str, ...], numbers: dict[str, float]) -> str:
    where = " and ".join(f"{name} = {numbers[name]:.4g}" for name in bounded)
    return f"{where} at a bound of the search: no optimum, ranked last" if where else ""


def _tidy(name: str, numbers: list[float]) -> list[float]:
    """Ogden's terms with the larger exponent first, and none that `Design` would refuse."""
    if name != "ogden":
        return numbers
    a1, a2 = (math.copysign(max(abs(alpha), LEAST_ALPHA), alpha) for alpha in numbers[:2])
    return [a1, a2, numbers[2]] if a1 >= a2 else [a2, a1, 1 - numbers[2]]


def aicc(n: int, k: int, rms: float) -> float:
    """Akaike's corrected criterion of n points and k parameters; infinite where it is not defined.

    >>> aicc(10, 2, 1.0)
    5.714285714285714
    """
    return math.inf if n <= k + 1 else 2 * n * math.log(rms) + 2 * k + 2 * k * (k + 1) / (n - k - 1)


def stable_ranges(
    name: str, numbers: tuple[float, ...], also: tuple[float, float] = RANGE
) -> dict[str, tuple[float, float]]:
    """Stretches round 1 between which the law is stable in each of `MODES`; looked for in `RANGE` and `also`.

    >>> stable_ranges("neo-hookean", ())["planar"]
    (0.3, 4.0)
    """
    found = {}
    for mode, strains in MODES.items():
        ends = RANGE if mode != "uniaxial" else (min(RANGE[0], also[0]), max(RANGE[1], also[1]))
        reached = []
        for end in ends:
            stretch = np.exp(np.linspace(0, math.log(end), 400))
            stretch[-1] = end
            # the stretch of a mode is that of its first direction
            good = stable(name, numbers, stretch, np.array(strains) / strains[0])
            last = len(good) - 1 if good.all() else max(int(np.argmin(good)) - 1, 0)
            reached.append(float(stretch[last]))
        found[mode] = (reached[0], reached[1])
    return found


def stable(name: str, numbers: tuple[float, ...], stretch: Array, strains: Array) -> NDArray[np.bool_]:
    """Whether the law is stable at stretches, shape (n,), of a mode with strains, shape (3,), over log(stretch)."""
    tau, D = drucker.stiffness(law(name, numbers), np.log(stretch)[:, None] * strains)
    # the pressure that frees the last direction of stress
    tau = tau - tau[:, 2:]
    along = (D @ strains) @ strains - tau @ strains**2
    return np.asarray((drucker.least(D) > 0) & (along > 0))


def run(path: str, nu: float, folder: Path | None) -> list[dict[str, Any]]:
    """Fit the test in a file; writes fit.csv, fit.png and design.toml into an existing folder.

    Returns
    -------
    A record for each law, the best first; `chosen` marks the one in design.toml, the best that is stable throughout.
    Where E is none that a design may have, a warning says so, and where that leaves no law there is no design.toml.
    """
    data = read(path)
    if folder is not None:
        _refuse_foreign(folder / "design.toml")
    fits = fit(data, nu)
    low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
    possible = [low <= found.E <= high for found in fits]
    chosen = next(
        (found for found, fits_in in zip(fits, possible, strict=True) if fits_in and found.everywhere), None
    )
    records = [record(found, rank, found is chosen) for rank, found in enumerate(fits, start=1)]
    for row, fits_in in zip(records, possible, strict=True):
        if not fits_in:
            unit = data.column.rpartition("_")[2]
            text = (
                f"{row['law']}: E = {row['E_MPa']:.4g} MPa is none that a design may have, {low:g} to {high:g} MPa:"
                f" check that the column {data.column} is in {unit}"
            )
            row["warning"] = "; ".join(filter(None, (row["warning"], text)))
    if folder is not None:
        from studies import plots
        from studies.compare import write_table

        write_table(folder / "fit.csv", [flat(row) for row in records])
        smooth = np.geomspace(data.stretch.min(), data.stretch.max(), 300)
        curves = {found.law: [_model(found, x, nu).tolist() for x in (smooth, data.stretch)] for found in fits}
        plots.fit(folder / "fit.png", data.stretch.tolist(), data.stress.tolist(), smooth.tolist(), curves)
        if chosen is not None:
            write_text(folder / "design.toml", design_text(path, chosen, nu))
    return records


def _refuse_foreign(file: Path) -> None:
    """A design that was not written here is somebody's own: it must not be replaced."""
    if file.exists() and not file.read_bytes().startswith(MARK.encode()):
        raise BadInput(f"{str(file)!r} was not written by magtip fit and would be replaced: choose another folder")


def _model(found: Fit, stretch: Array, nu: float) -> Array:
    return found.E / (2 * (1 + nu)) * nominal_stress(found.law, tuple(found.numbers.values()), stretch)


def record(found: Fit, rank: int, chosen: bool) -> dict[str, Any]:
    """One fit under the names that leave the program."""
    return {
        "rank": rank,
        "law": found.law,
        "chosen": chosen,
        "AICc": found.aicc,
        "rms_MPa": found.rms,
        "rms_percent": 100 * found.share,
        "E_MPa": found.E,
        "numbers": found.numbers,
        **{f"stable_{mode}": list(ends) for mode, ends in found.stable.items()},
        "warning": found.warning,
    }


def flat(row: dict[str, Any]) -> dict[str, Any]:
    """A record for a table: numbers and ranges as texts."""
    texts = {"numbers": ", ".join(f"{name}={value:.6g}" for name, value in row["numbers"].items())}
    for mode in MODES:
        low, high = row[f"stable_{mode}"]
        texts[f"stable_{mode}"] = f"{low:.3g} to {high:.3g}"
    return {**row, **texts}


def design_text(path: str, found: Fit, nu: float) -> str:
    """The fit as a design file."""
    values: dict[str, Any] = {"E": found.E, "nu": nu, "law": found.law, **found.numbers}
    lines = [
        f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value!r}" for name, value in values.items()
    ]
    origin = "".join(letter if letter.isprintable() else "?" for letter in Path(path).name)
    return "\n".join([f"{MARK}{origin}: rms residual {100 * found.share:.3g} % of the largest stress", *lines, ""])
