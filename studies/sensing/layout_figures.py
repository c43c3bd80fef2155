"""Figures of a layout: maps over x and z, and the share of ambiguous poses over c."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from studies.output.figures import COLOURS, Figure, Guide, Look, heat, numbers, plot, texts

if TYPE_CHECKING:
    import pandas as pd

    from analytic.decode import Decoder
    from analytic.survey import Survey

STATES = {"tilt not known": "#ffffff", "saturated": "#cfcfcf", "blocked": "#8a8a8a"}
"""What a place without a usable pose is, and its colour."""
SIGNS = {"< 0": COLOURS[0], "both": "#F0E442", "> 0": COLOURS[1]}
EQUAL = {"1": "#440154", "2": "#31688e", "3": "#35b779", "4 or more": "#fde725"}
"""Numbers of poses with the same readings that the colours distinguish."""
DECADES = 1e3
"""Largest ratio of the ends of a colour scale: values near a fold grow without bound."""
NONE = 0.01
"""Share at which none is drawn on a logarithmic axis, %."""


def maps(coder: Decoder, box: Survey, room: float = 0.0) -> list[Figure]:
    """Return condition number, sign of det J, multiplicity and noise over x and z: at y = 0, and the worst over y."""
    import pandas as pd

    from analytic import survey

    x, _, z = (np.unique(axis) for axis in box.shift)
    shift = np.stack(np.meshgrid(x, [0.0], z, indexing="ij")).reshape(3, -1)
    plane = survey.at_poses(coder, shift, np.ones(shift.shape[1]), (len(x), 1, len(z)), clearance=room)
    cells = pd.concat(
        [_cells(plane).assign(panel="plane y = 0"), _cells(box).assign(panel="worst over all y")], ignore_index=True
    )
    axes = ("shift x (mm)", "shift z (mm)")
    values = {
        "condition number": "Condition number",
        "sign of det J": "Sign of det J, of the readings by the shift",
        "poses with equal readings": "Poses with equal readings",
        "noise (µm)": "Noise of the decoded shift",
    }
    colours = {"sign of det J": SIGNS | STATES, "poses with equal readings": EQUAL | STATES}
    return [
        heat(title, "", cells[[*axes, "panel", name]], axes, name, colours=colours.get(name, {}))
        for name, title in values.items()
    ]


def _cells(poses: Survey) -> pd.DataFrame:
    """Return the worst values over y at each place of x and z; a place without a usable pose has its reason."""
    import pandas as pd

    counts, usable = poses.counts, poses.usable.reshape(poses.counts)

    def worst(values: object, least: bool = False) -> np.ndarray:
        every = np.asarray(values, dtype=np.float64).reshape(counts)
        if least:
            return np.asarray(np.where(usable, every, np.inf).min(axis=1))
        return np.asarray(np.where(usable, every, -np.inf).max(axis=1))

    known = poses.weight > 0
    free, seen = (part.reshape(counts).any(axis=1) for part in (known & ~poses.blocked, known))
    some = usable.any(axis=1)
    place = np.where(worst(poses.sign) == worst(poses.sign, least=True), worst(poses.sign), 0.0)
    sign = np.take(list(SIGNS), np.where(some, place, 0.0).astype(int) + 1)
    unknown, saturated, blocked = STATES
    state = np.where(free, saturated, np.where(seen, blocked, unknown))
    x, z = poses.shift[0].reshape(counts)[:, 0, 0], poses.shift[2].reshape(counts)[0, 0]
    grid = np.meshgrid(np.round(x, 4), np.round(z, 4), indexing="ij")
    equal = np.clip(np.where(some, worst(poses.multiplicity), 1), 1, len(EQUAL)).astype(int)
    many = np.take(list(EQUAL), equal - 1)
    table = {
        "shift x (mm)": grid[0],
        "shift z (mm)": grid[1],
        "condition number": _limited(np.where(some, worst(poses.condition), np.nan)),
        "sign of det J": np.where(some, sign, state),
        "poses with equal readings": np.where(some, many, state),
        "noise (µm)": _limited(np.where(some, 1e3 * worst(poses.noise_mm), np.nan)),
    }
    return pd.DataFrame({name: values.ravel() for name, values in table.items()})


def _limited(values: np.ndarray) -> np.ndarray:
    known = values[np.isfinite(values) & (values > 0)]
    return np.minimum(values, DECADES * known.min()) if len(known) else values


def claim(table: pd.DataFrame, c: float) -> list[Figure]:
    """Return the ambiguous share of the workspace over c, of the rows of claim.csv.

    Parameters
    ----------
    c : height of the given layout, mm.
    """
    import pandas as pd

    x, y = "height c of S2 and S3 over S1 (mm)", "ambiguous poses (%)"
    magnets = zip(numbers(table, "magnet_height_mm"), numbers(table, "l0_mm"), strict=True)
    data = pd.DataFrame({
        x: numbers(table, "c_mm"),
        y: numbers(table, "alike_percent").clip(lower=NONE),
        "panel": [f"magnet {height:g} mm high, l0 = {l0:g} mm" for height, l0 in magnets],
        "series": texts(table, "readings"),
    })  # fmt: skip
    look = Look(log="y", columns=1, guides=(Guide("x", c, "the given layout"),))
    return [plot("Ambiguous share of the workspace", f"{NONE:g} % stands for none.", data, x, y, look)]
