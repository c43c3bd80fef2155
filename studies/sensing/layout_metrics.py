"""What the map of a layout says of it: shares of the workspace, condition number, noise, and the verdict.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from studies.inputs.option_groups import Basis
from studies.sensing import decode_readings

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.inverse.response_surface import Mechanics
    from analytic.survey import Survey

ABOUT = """\
Shares are of the poses in the decoder's workspace that the mechanics know. They add up: a pose is blocked (the magnet
or the beam's estimated wall meets an element, or the magnet the base), else saturated, else ambiguous, else unique.
It is ambiguous where the decoder finds other poses with the same readings, be those blocked or not.
Condition number and noise are those of the poses that are neither blocked nor saturated. The noise is the standard
deviation along the worst direction.
"""

Row = dict[str, Any]

COUNTS = (25, 25, 13)
"""Poses of the map along x, y and z."""


def mechanics_of(design: Design, level: str | None, responses: Path | None) -> Mechanics:
    """As `studies.sensing.decode_readings.mechanics_of`; a design without a magnet is refused first."""
    if not design.shape.has_magnet:
        raise BadInput(
            "this design has no magnet (magnet_diameter is 0), so there is nothing to read: give it a magnet"
        )
    return decode_readings.mechanics_of(design, level, responses)


def prepare(
    design: Design,
    law: Mechanics,
    basis: Basis,
    cells: tuple[int, int, int] | None = None,
) -> tuple[Decoder, str]:
    """The decoder of a design whose elements have some noise, and where that comes from.

    Raises
    ------
    BadInput
        What `analytic.decode.decoder` refuses, or a chip's |B|, which is the same along all its axes.
    """
    from analytic import decode, parts

    if basis.mode == "magnitude" and design.hall_layout != "three":
        raise BadInput("a 3-axis chip gives only one |B|, which cannot determine a pose: leave --mode magnitude out")
    elements, source = parts.with_noise(parts.of_design(design))
    coder = decode.decoder(
        design,
        law,
        ignore_tilt=basis.ignore_tilt,
        elements=elements,
        mode=basis.mode,
        cells=cells or decode.CELLS,
    )
    return coder, source


def record(coder: Decoder, seen: Survey, noise: str, mechanics: str) -> Row:
    """Everything that there is to say of a layout in numbers."""
    design, elements = coder.forward.design, coder.forward.elements
    three = design.hall_layout == "three"
    found = {
        "status": "ok",
        "message": "",
        "layout": design.hall_layout,
        "elements": [element.name for element in elements],
        "f_mm": design.f if three else None,
        "l0_mm": design.l0,
        "c_mm": design.c if three else None,
        "chip_x_mm": None if three else design.chip_x,
        "mechanics": mechanics,
        "tilt": "followed" if coder.forward.tau.any() else "none",
        "mode": coder.forward.mode,
        "workspace_mm": [coder.low.tolist(), coder.high.tolist()],
        "poses": len(seen.weight),
        "known_percent": 100 * float((seen.weight > 0).mean()),
        **figures(seen),
        "noise_of_readings_T": coder.sigma.tolist(),
        "noise_source": noise,
        "hits": _hits(coder, seen),
        "warnings": design.warnings(),
    }
    return found | {"message": sentence(found)}


def figures(seen: Survey) -> Row:
    """Shares, determinant, condition number and noise; infinite on a fold, None where no pose is left to judge."""
    import numpy as np

    many, usable = seen.multiplicity > 1, seen.usable
    known = seen.weight > 0
    found: Row = {
        "unique_percent": 100 * seen.share(usable & ~many),
        "ambiguous_percent": 100 * seen.share(usable & many),
        "saturated_percent": 100 * seen.share(seen.saturated & ~seen.blocked),
        "blocked_percent": 100 * seen.share(seen.blocked),
        "det_positive_percent": 100 * seen.share(seen.sign > 0),
        "det_negative_percent": 100 * seen.share(seen.sign < 0),
        "folded": seen.folded,
        "most_alike": int(seen.multiplicity[known].max()),
        "alike_apart_mm": float(seen.alike_mm[usable & many].max(initial=0.0)),
    }
    for name, values, factor in (
        ("condition", seen.condition, 1.0),
        ("noise_um", seen.noise_mm, 1e3),
        ("noise_N", seen.noise_N, 1.0),
    ):
        some = factor * values[usable]
        stem, _, unit = name.partition("_")
        end = f"_{unit}" if unit else ""
        found[f"{stem}_median{end}"] = float(np.median(some)) if len(some) else None
        worst = np.inf if seen.folded else some.max() if len(some) else np.nan
        found[f"{stem}_worst{end}"] = float(worst) if len(some) else None
    at = np.flatnonzero(usable)
    found["worst_at_mm"] = seen.shift[:, at[seen.noise_mm[at].argmax()]].tolist() if len(at) else None
    return found


def _hits(coder: Decoder, seen: Survey) -> list[str]:
    """What gets into whose way, in sentences."""
    found = []
    for what, flags in (("the magnet", seen.magnet_hits), ("the beam's wall (estimate)", seen.wall_hits)):
        for element, hit in zip(coder.forward.elements, flags, strict=True):
            share = seen.share(hit)
            if share > 0:
                found.append(f"{what} meets {element.name} in {_percent(100 * share)} of the workspace")
    if seen.share(seen.grounded) > 0:
        found.append(f"the magnet meets the base in {_percent(100 * seen.share(seen.grounded))} of the workspace")
    return found


def sentence(found: Row) -> str:
    """The verdict."""
    clear = found["unique_percent"] + found["ambiguous_percent"]
    if not clear > 0:
        return "no pose in the workspace is usable: each is blocked by an element or saturated"
    parts = []
    if not found["ambiguous_percent"] > 0:
        parts.append(
            "the readings are unique: no two poses in the workspace give the same readings"
            if clear > 100 - 1e-6
            else f"the readings are unique in the usable {_percent(clear)} of the workspace"
        )
    else:
        parts.append(
            f"{_percent(found['ambiguous_percent'])} of the workspace is ambiguous: poses up to "
            f"{found['alike_apart_mm']:.2g} mm apart give the same readings"
        )
    if found["folded"]:
        parts.append(
            "det J changes sign on a surface in the workspace: condition number and noise are infinite there"
        )
    return "; ".join(parts)


def _percent(value: float) -> str:
    """A share with as many digits as it needs, never rounded to 0 or 100.

    >>> _percent(0.004), _percent(12.3456), _percent(99.98), _percent(100.0)
    ('below 0.01 %', '12.3 %', '99.98 %', '100 %')
    """
    if 0 < value < 0.01:
        return "below 0.01 %"
    return f"{value:.3g} %" if value < 99.5 else f"{value:.4g} %"


def table(coder: Decoder, seen: Survey) -> Iterator[Row]:
    """A row for each pose of the map."""
    from analytic.parts import columns

    names = columns(coder.forward.elements)
    known, blocked = seen.weight > 0, seen.blocked
    tilt, tilt_y = tilts_of(*seen.tilt)
    for k in range(len(known)):
        x, y, z = seen.shift[:, k].tolist()
        row: Row = {"x_mm": x, "y_mm": y, "z_mm": z, "tilt_rad": tilt[k], "tilt_y_rad": tilt_y[k]}
        row |= {f"{name}_mT": 1e3 * b for name, b in zip(names, seen.readings[:, k].tolist(), strict=True)}
        yield row | {
            "known": int(known[k]),
            "blocked": int(blocked[k]),
            "saturated": int(seen.saturated[k]),
            "det_sign": int(seen.sign[k]),
            "condition": seen.condition[k],
            "multiplicity": int(seen.multiplicity[k]) or None,
            "alike_apart_mm": seen.alike_mm[k],
            "noise_um": 1e3 * seen.noise_mm[k],
            "noise_N": seen.noise_N[k],
        }
