"""The surrogate: Gaussian processes that interpolate between training points, and the file that keeps these.

A NumPy archive of numbers and one text, read without pickle. A group is a Gaussian process for several quantities at
several nodes (depths of training, or shears): outputs are ordered with the quantities first. All else follows from
the training points in some 50 ms, once per process.

All outputs y_q share one correlation of their deviations from a linear trend,

    y_q(x) = beta_q . (1, x) + s_q z_q(x),    cov(z_q(x), z_q(x')) = c(r) + nugget [x = x'],
    r^2 = sum_i ((x_i - x'_i) / l_i)^2,       c(r) = (1 + a + a^2 / 3) exp(-a),  a = 5^(1/2) r,

Matern's correlation of order 5/2 with a length scale l_i for each input (Rasmussen and Williams 2006, chapters 2 and
4). With K the correlations of the training points, the best linear unbiased prediction is

    y(x) = (1, x) beta + k(x) K^-1 (Y - H beta),    beta = (H^T K^-1 H)^-1 H^T K^-1 Y,

and its spread relative to s_q is g(x)^2 = 1 + nugget - k K^-1 k + u (H^T K^-1 H)^-1 u with u = h(x) - H^T K^-1 k.
The spread is the same for all outputs, and is used for its shape over x only: intervals are calibrated on errors
(see `studies.validation.surrogate`). Everything follows from the training points within 20 ms, so files hold
these alone.
"""

from __future__ import annotations

import functools
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import linalg

from fem.accuracy import STANDARD
from fem.physics_version import PHYSICS, outdated
from geometry.arrays import Array
from geometry.design import BadInput

ROOT5 = np.sqrt(5.0)


@dataclass(frozen=True)
class GaussianProcess:
    """A Gaussian process conditioned on training points.

    x : training points, shape (N, p).
    y : outputs, shape (N, q).
    lengths : length scale of each input, shape (p,).
    nugget : variance of the noise over that of the process.
    """

    x: Array
    y: Array
    lengths: Array
    nugget: float

    @functools.cached_property
    def factor(self) -> Array:
        """Lower Cholesky factor of K, shape (N, N)."""
        K = correlation(self.x / self.lengths, self.x / self.lengths)
        K[np.diag_indices_from(K)] += self.nugget
        return np.asarray(linalg.cholesky(K, lower=True))

    @functools.cached_property
    def _trend(self) -> tuple[Array, Array, Array]:
        """L^-1 H, the Cholesky factor of H^T K^-1 H, and the trend's coefficients (p + 1, q)."""
        whitened = linalg.solve_triangular(self.factor, with_constant(self.x), lower=True)
        gram = linalg.cholesky(whitened.T @ whitened, lower=True)
        y = linalg.solve_triangular(self.factor, self.y, lower=True)
        return whitened, gram, linalg.cho_solve((gram, True), whitened.T @ y)

    @functools.cached_property
    def weights(self) -> Array:
        """K^-1 (Y - H beta), shape (N, q)."""
        rest = self.y - with_constant(self.x) @ self._trend[2]
        return np.asarray(linalg.cho_solve((self.factor, True), rest))

    @functools.cached_property
    def root(self) -> Array:
        """Inverse of `factor`, shape (N, N): products with it take half the time of solves."""
        return np.asfortranarray(linalg.solve_triangular(self.factor, np.eye(len(self.x)), lower=True))

    @functools.cached_property
    def inverse(self) -> Array:
        """K^-1 - K^-1 H (H^T K^-1 H)^-1 H^T K^-1, shape (N, N): the precision of the deviations from the trend."""
        whitened, gram, _ = self._trend
        half = linalg.solve_triangular(gram, whitened.T, lower=True)
        across = half @ self.root
        return np.asarray(self.root.T @ self.root - across.T @ across)

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Return prediction (n, q) and relative spread g (n,) at points (n, p)."""
        k = correlation(x / self.lengths, self.x / self.lengths)
        whitened, gram, trend = self._trend
        mean = with_constant(x) @ trend + k @ self.weights
        v = linalg.blas.dtrmm(1.0, self.root, k.T, lower=1, overwrite_b=1)
        u = linalg.blas.dtrsm(1.0, gram, with_constant(x).T - whitened.T @ v, lower=1)
        square = 1 + self.nugget - np.einsum("in,in->n", v, v) + np.einsum("in,in->n", u, u)
        return mean, np.sqrt(np.maximum(square, self.nugget))

    def left_out(self) -> tuple[Array, Array]:
        """Return for each training point its prediction from all others (N, q), and the spread g (N,) there.

        In closed form (Dubrule 1983): the error is the weight over the diagonal of `inverse`.
        """
        diagonal = np.diag(self.inverse)
        return self.y - (self.inverse @ self.y) / diagonal[:, None], 1 / np.sqrt(diagonal)


def with_constant(x: Array) -> Array:
    """Return points (n, p) with a leading 1, shape (n, p + 1)."""
    return np.hstack([np.ones((len(x), 1)), x])


def correlation(one: Array, other: Array) -> Array:
    """Return the correlations of points (n, p) and (m, p), in units of the length scales, shape (n, m)."""
    square = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2 * one @ other.T
    a = np.sqrt(np.maximum(square, 0.0), out=square)
    a *= ROOT5
    decay = np.exp(-a)
    a *= 1 + a / 3
    a += 1
    a *= decay
    return np.asarray(a)


FILE = Path(__file__).with_name("surrogate.npz")
"""The shipped surrogate, written by `magtip validate surrogate`."""
FORMAT = 2
"""Version of the file's format, and of what its numbers mean (`studies.beam.prediction`)."""
ANSWERS: tuple[Literal["axisymmetric", "harmonic", "critical depth", "modes"], ...]
ANSWERS = ("axisymmetric", "harmonic", "critical depth", "modes")
"""Finite elements that the surrogate is trained on, calibrated and tested by (`fem.physics_version`)."""
REMEDY = "build it again with `magtip validate surrogate`, or take finite elements"


@dataclass(frozen=True)
class Group:
    """A Gaussian process of several quantities at several nodes.

    `quantiles`: by quantity, 90 % quantile of the errors of training beams that were left out, over g and over the
    yardstick of the quantity (see `studies.beam.prediction`), by region and node, shape (regions, nodes).
    """

    process: GaussianProcess
    quantities: tuple[str, ...]
    nodes: int
    quantiles: Mapping[str, Array]


@dataclass(frozen=True)
class Surrogate:
    """All groups by name: press, strain, mode, shear; and how they were made.

    `about`: physics versions, level of accuracy, numbers of beams, versions of the packages and the commit.
    """

    groups: Mapping[str, Group]
    about: Mapping[str, Any]


def write(file: Path, surrogate: Surrogate) -> None:
    """Write a surrogate of today's finite elements."""
    about = dict(surrogate.about) | {"format": FORMAT, "physics": {name: PHYSICS[name] for name in ANSWERS}}
    arrays: dict[str, Any] = {"about": np.array(json.dumps(about))}
    for name, group in surrogate.groups.items():
        process = group.process
        arrays |= {
            f"{name}.x": process.x,
            f"{name}.y": process.y,
            f"{name}.lengths": process.lengths,
            f"{name}.nugget": np.array(process.nugget),
            f"{name}.quantities": np.array(group.quantities),
            f"{name}.nodes": np.array(group.nodes),
        }
        arrays |= {f"{name}.quantiles.{quantity}": values for quantity, values in group.quantiles.items()}
    with open(file, "wb") as target:
        np.savez_compressed(target, **arrays)


def read(file: Path) -> Surrogate:
    """Read a surrogate."""
    try:
        with np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        about = json.loads(str(arrays["about"]))
        if about["format"] != FORMAT:
            raise BadInput(f"{file.name} has format {about['format']}, and this version reads {FORMAT}: {REMEDY}")
        today: dict[str, int] = {name: PHYSICS[name] for name in ANSWERS}
        for name in outdated(about["physics"], today):
            raise BadInput(
                f"{file.name} was trained on version {about['physics'].get(name)} of the finite elements "
                f"({name}), and this magtip has version {today[name]}: {REMEDY}"
            )
        names = {name.split(".")[0] for name in arrays if "." in name}
        return Surrogate({name: _group(name, arrays) for name in sorted(names)}, about)
    except (OSError, EOFError, zipfile.BadZipFile, ValueError, KeyError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{str(file)!r} is no surrogate: {error}") from None


def _group(name: str, arrays: Mapping[str, Any]) -> Group:
    process = GaussianProcess(
        x=arrays[f"{name}.x"],
        y=arrays[f"{name}.y"],
        lengths=arrays[f"{name}.lengths"],
        nugget=float(arrays[f"{name}.nugget"]),
    )
    before = f"{name}.quantiles."
    return Group(
        process,
        tuple(str(quantity) for quantity in arrays[f"{name}.quantities"]),
        int(arrays[f"{name}.nodes"]),
        {key.removeprefix(before): values for key, values in arrays.items() if key.startswith(before)},
    )


@functools.cache
def shipped() -> Surrogate:
    """Return the surrogate that magtip ships."""
    surrogate = read(FILE)
    if surrogate.about["accuracy"] != STANDARD.name:
        raise BadInput(
            f"{FILE.name} was trained at accuracy {surrogate.about['accuracy']}, and magtip ships {STANDARD.name}: "
            f"{REMEDY}"
        )
    return surrogate
