"""Figures of tests with what was fitted to them (`magtip fit`): laws, or branches, and what they leave over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.output.figures import Figure, Guide, Look, plot

if TYPE_CHECKING:
    import pandas as pd

    from studies.simulation.relaxation_test import Test

ZERO = (Guide("y", 0.0),)


def laws(stretch: Array, stress: Array, smooth: Array, curves: Mapping[str, tuple[Array, Array]]) -> list[Figure]:
    """Return a uniaxial test with the laws fitted to it, the best first, and what they leave over.

    Parameters
    ----------
    stretch, stress : points of the test, shape (n,), the stress in MPa.
    smooth : stretches of the curves.
    curves : for each law the stress at `smooth` and at `stretch`, MPa.
    """
    x, y, rest = "stretch", "nominal stress (MPa)", "law less test (% of the largest)"
    whole = {law: (smooth, curve) for law, (curve, _) in curves.items()}
    left = {law: (stretch, 100 * (at - stress) / np.abs(stress).max()) for law, (_, at) in curves.items()}
    names = ("test", *curves)
    data = _joined(x, y, {"test": (stretch, stress)}, whole)
    return [
        plot("Uniaxial test and laws", "", data, x, y, Look(names=names)),
        plot("What the laws leave over", "", _joined(x, rest, left, {}), x, rest, Look(names=names, guides=ZERO)),
    ]


def branches(test: Test, smooth: Array, curve: NDArray[Any], at_points: NDArray[Any]) -> list[Figure]:
    """Return a test with the fitted branches: the moduli, and the loss factor or what the fit leaves over.

    Parameters
    ----------
    smooth : times, s, or frequencies, Hz, of the curve.
    curve, at_points : fitted E(t), or E' + i E'', at `smooth` and at the points of the test, MPa.
    """
    unit = "(MPa)" if test.has_modulus else "(MPa, nominal)"
    if test.kind == "dynamic":
        x, y, loss = "frequency (Hz)", f"modulus {unit}", "loss factor"
        measured = {f"{name}, test": (test.at, part(test.values)) for name, part in PARTS.items()}
        fitted = {f"{name}, fit": (smooth, part(curve)) for name, part in PARTS.items()}
        factors = {"test": (test.at, test.values.imag / test.values.real)}
        fit = {"fit": (smooth, curve.imag / curve.real)}
        return [
            plot("Moduli of the test and of the branches", "", _joined(x, y, measured, fitted), x, y, Look(log="xy")),
            plot("Loss factor", "", _joined(x, loss, factors, fit), x, loss, Look(log="x")),
        ]
    x, y = "time (s)", f"{'modulus E(t)' if test.has_modulus else 'stress'} {unit}"
    rest = "fit less test (% of the largest)"
    left = {"fit": (test.at, 100 * (at_points - test.values) / test.values.max())}
    data = _joined(x, y, {"test": (test.at, test.values)}, {"fit": (smooth, curve)})
    look = Look(log="x", guides=ZERO, names=("test", "fit"))
    return [
        plot("Relaxation of the test and of the branches", "", data, x, y, Look(log="x")),
        plot("What the branches leave over", "", _joined(x, rest, left, {}), x, rest, look),
    ]


PARTS = {"storage": np.real, "loss": np.imag}


def _joined(
    x: str, y: str, points: Mapping[str, tuple[Array, Array]], lines: Mapping[str, tuple[Array, Array]]
) -> pd.DataFrame:
    """Return points and lines by their names as the table of a plot; without lines the points are joined, too."""
    import pandas as pd

    parts = [
        pd.DataFrame({x: at, y: values}).assign(series=name, joined=line)
        for line, curves in ((False, points), (True, lines))
        for name, (at, values) in curves.items()
    ]
    data = pd.concat(parts, ignore_index=True)
    return data if lines else data.drop(columns="joined")
