"""The surrogate's file: training points, length scales and calibrated errors of each group of outputs.

A NumPy archive of numbers and one text, read without pickle. A group is a Gaussian process for several quantities at
several nodes (depths of training, or shears): outputs are ordered with the quantities first. All else follows from
the training points in some 50 ms, once per process.
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

from fem.accuracy import STANDARD
from fem.physics_version import PHYSICS, outdated
from geometry.arrays import Array
from geometry.design import BadInput
from studies.mechanics.gaussian_process import GaussianProcess

FILE = Path(__file__).with_name("surrogate.npz")
"""The shipped surrogate, written by `magtip validate surrogate`."""
FORMAT = 2
"""Version of the file's format, and of what its numbers mean (`studies.mechanics.prediction`)."""
ANSWERS: tuple[Literal["axisymmetric", "harmonic", "critical depth", "modes"], ...] = (
    *("axisymmetric", "harmonic"),
    *("critical depth", "modes"),
)
"""Finite elements that the surrogate is trained on, calibrated and tested by (`fem.physics_version`)."""


@dataclass(frozen=True)
class Group:
    """A Gaussian process of several quantities at several nodes.

    Attributes
    ----------
    quantities : names of the quantities.
    nodes : number of nodes of each quantity.
    quantiles : by quantity, 90 % quantile of the errors of training beams that were left out, over g and over the
        yardstick of the quantity (see `studies.mechanics.prediction`), by region and node, shape (regions, nodes).
    """

    process: GaussianProcess
    quantities: tuple[str, ...]
    nodes: int
    quantiles: Mapping[str, Array]


@dataclass(frozen=True)
class Surrogate:
    """All groups by name: press, strain, mode, shear; and how they were made.

    Attributes
    ----------
    about : physics versions, level of accuracy, numbers of beams, versions of the packages and the commit.
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


REMEDY = "build it again with `magtip validate surrogate`, or take finite elements"


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
