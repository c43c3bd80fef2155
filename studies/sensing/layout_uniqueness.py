"""Whether readings are unique to each place of the magnet: the paper's claim, answered with numbers.

ABOUT, which the report prints, says how.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.sensing import layout_metrics

if TYPE_CHECKING:
    from analytic.decode import Decoder
    from analytic.hall import Mode
    from analytic.inverse.response_surface import Mechanics
    from analytic.survey import Survey


ABOUT = """\
The paper fills a table of readings over its workspace, sees in a plot for one depth that they are unique to each
location, and takes the place of the magnet from it. Three forms of the readings are asked here: |B| of the elements
and a magnet that stays upright, as the paper has it; B.n, as an element reads; and B.n of a magnet that tilts by the
formulas of level `finite`, in the part of the workspace that these know. The field is exact; the paper's (3), without
its misprint, is the same field by quadrature. Rails are taken away, so that what is ambiguous is so by the field;
poses at which something would be in the way are left in. The height c of S2 and S3, which the paper does not give, is
varied, and the height of the magnet, which it does not give either, with S1 at the distance at which it reads the
same at rest. Where c > l0 - H, S2 and S3 stand beside the beam, and its wall meets them in part of the workspace.
Unique means that of a grid of 13 x 13 x 7 poses none has its readings in common with any other of the workspace.

Two poses read alike where all three readings are equal. How far others are from that: the least distance in the
readings, over their noise (root of the sum of squares), of two poses that are at least so far apart. The paper's
displacements of the tip, up to 3 mm along each axis, move the magnet by H/L of that: its workspace is part of the one
here.
"""

Row = dict[str, Any]

FORMS: dict[str, tuple[Mode, str, bool]] = {
    "|B|, no tilt (the paper's)": ("magnitude", "paper", True),
    "B.n, no tilt": ("component", "paper", True),
    "B.n, tilt": ("component", "finite", False),
}
"""Mode, level of the mechanics, and whether the tilt is ignored."""
HEIGHTS = (1.0, 1.5, 2.0)
"""Of the magnet, over the design's."""
STEP, BISECTIONS = 1 / 16, 3
"""Of c, over D; the limit of c is found to an eighth of it."""
POSES = (13, 13, 7)
APART = (1 / 800, 1 / 80, 1 / 8)
"""Over D."""
WIDE = 1e6
"""Rails that no field reaches, in units of an output."""


def run(design: Design, progress: Progress) -> dict[str, list[Row]]:
    """ "forms": the design's own layout, form by form; "limits": up to which c each form is unique; "heights": all c.

    Raises
    ------
    BadInput
        The layout is a chip, or the design's elements cannot be decoded.
    """
    check(design)
    magnets = list(_magnets(design))
    work = [(magnet, form) for magnet in magnets for form in FORMS]
    forms = []
    for k, form in enumerate(FORMS):
        progress(0.2 * k / len(FORMS), "the claim: the given layout")
        forms.append({"readings": form} | _own(design, form))
    heights, limits = [], []
    for k, (magnet, form) in enumerate(work):
        progress(0.2 + 0.8 * k / len(work), f"the claim: magnet {magnet.magnet_height:g} mm high")
        law = law_of(magnet, form)
        rows = _scan(magnet, form, law)
        heights += rows
        limits.append(_limit(magnet, form, law, rows))
    progress(1.0, "the claim")
    return {"forms": forms, "limits": limits, "heights": heights}


def check(design: Design) -> None:
    """Refuse a design that the claim is not about."""
    if design.hall_layout != "three":
        raise BadInput("the claim is about three elements: give hall_layout=three, or leave --claim out")


def answer(claim: dict[str, list[Row]]) -> list[str]:
    """The claim, judged for the given layout and over c, in sentences."""
    forms, own = claim["forms"], claim["limits"][0]["magnet_height_mm"]
    failing = [row for row in forms if row["alike_percent"]]
    lines = []
    if not failing:
        lines.append("For the given layout the claim holds in every form: no two poses give the same readings.")
    for row in failing:
        lines.append(
            f"{row['readings']}: the claim fails for the given layout; {row['alike_percent']:.2g} % of the poses"
            f" share their readings with others, up to {row['alike_apart_mm']:.2g} mm away."
        )
    for row in forms:
        near, far = [key for key in row if key.startswith("difference_at_")][:2]
        if not row["alike_percent"]:
            lines.append(
                f"{row['readings']}: two poses {_mm(near)} mm apart differ in their readings by {row[near]:.2g} times"
                f" the noise at least, {_mm(far)} mm apart by {row[far]:.2g} times."
            )
    for limit in (row for row in claim["limits"] if row["magnet_height_mm"] == own):
        scan = [r for r in claim["heights"] if (r["magnet_height_mm"], r["readings"]) == (own, limit["readings"])]
        worst = max(scan, key=lambda row: row["alike_percent"])
        if worst["alike_percent"]:
            low, high = limit["unique_from_c_mm"], limit["unique_to_c_mm"]
            ends = " and".join(
                f" {name} c = {end:.2g} mm" for name, end in (("below", low), ("above", high)) if end is not None
            )
            lines.append(
                f"{limit['readings']}, over c: fails{ends or ' at the given c'}; at c = {worst['c_mm']:.2g} mm"
                f" {worst['alike_percent']:.2g} % of the poses share their readings with others, up to"
                f" {worst['alike_apart_mm']:.2g} mm away."
            )
    for limit in claim["limits"]:
        if limit["magnet_height_mm"] != own and limit["below"] and not limit["unique"]:
            lines.append(
                f"{limit['readings']}, with a magnet {limit['magnet_height_mm']:g} mm high that gives S1 the same "
                f"reading at rest (l0 = {limit['l0_mm']:g} mm): fails at c = {limit['below']['c_mm']:g} mm, for"
                f" {limit['below']['alike_percent']:.2g} % of the poses."
            )
    return lines


def _mm(key: str) -> str:
    return key.removeprefix("difference_at_").removesuffix("_mm_over_noise")


def law_of(design: Design, form: str) -> Mechanics:
    """The mechanics of a form of the readings; the elements' places are nothing to it."""
    return layout_metrics.mechanics_of(design, FORMS[form][1], None)


def coder_of(design: Design, form: str, law: Mechanics) -> Decoder:
    """The decoder of a form of the readings, without rails."""
    from analytic import decode, parts

    mode, _, ignored = FORMS[form]
    elements, _ = parts.with_noise(parts.of_design(design))
    open_ = [dataclasses.replace(e, low=-WIDE, high=WIDE) for e in elements]
    return decode.decoder(design, law, ignore_tilt=ignored, elements=open_, mode=mode)


def _magnets(design: Design) -> Iterator[Design]:
    """The design, and those with taller magnets that S1 reads the same of at rest, as far as they fit."""
    import numpy as np
    from scipy.optimize import brentq

    from analytic.magnet import cylinder_field

    def at_rest(height: float, l0: float) -> float:
        point = np.array([[0.0, 0.0, l0]])
        return float(cylinder_field(point, design.magnet_diameter / 2, height, design.remanence)[0, 2])

    goal = at_rest(design.magnet_height, design.l0)
    for factor in HEIGHTS:
        height = factor * design.magnet_height
        l0 = brentq(lambda x, h=height: at_rest(h, x) - goal, height / 2, 10 * design.l0)
        try:
            yield dataclasses.replace(
                design, magnet_height=height, l0=design.l0 if factor == 1 else float(f"{l0:.3g}")
            )
        except BadInput:
            continue


def _own(design: Design, form: str) -> Row:
    """Figures of the given layout, with the least differences of readings."""
    from analytic import survey
    from analytic.inverse import nearest_readings

    coder = coder_of(design, form, law_of(design, form))
    seen = survey.survey(coder, POSES)
    row = _figures(seen)
    row["workspace_mm"] = [coder.low.tolist(), coder.high.tolist()]
    for share in APART:
        apart = share * design.D
        row[f"difference_at_{apart:.2g}_mm_over_noise"] = (
            nearest_readings.least_difference(coder, seen, apart) if not row["alike_percent"] else 0.0
        )
    return row


def _figures(seen: Survey) -> Row:
    """What reads alike, and where that is."""
    import numpy as np

    many = (seen.multiplicity > 1) & (seen.weight > 0)
    known = seen.weight > 0
    box = [[float(v[many].min()), float(v[many].max())] for v in seen.shift] if many.any() else None
    folds = min(seen.share(seen.sign > 0), seen.share(seen.sign < 0))
    return {
        "unique_percent": 100 * seen.share(seen.multiplicity == 1),
        "alike_percent": 100 * seen.share(many),
        "rarer_det_percent": 100 * folds,
        "alike_apart_mm": float(seen.alike_mm[many].max(initial=0.0)),
        "alike_x_mm": box and box[0],
        "alike_y_mm": box and box[1],
        "alike_z_mm": box and box[2],
        "blocked_percent": 100 * seen.share(seen.blocked),
        "condition_worst": float(np.max(seen.condition[known])) if not folds else np.inf,
    }


def _scan(design: Design, form: str, law: Mechanics) -> list[Row]:
    """A row for each c, from 0 to the height of the magnet's centre at rest."""
    step = STEP * design.D
    rows = []
    for k in range(round(design.l0 / step)):
        found = _at(design, form, law, k * step)
        if found is not None:
            rows.append(found)
    return rows


def _at(design: Design, form: str, law: Mechanics, c: float) -> Row | None:
    from analytic import survey

    changed = dataclasses.replace(design, c=c)
    row = {"magnet_height_mm": design.magnet_height, "l0_mm": design.l0, "c_mm": c, "readings": form}
    try:
        return row | _figures(survey.survey(coder_of(changed, form, law), POSES))
    except BadInput:
        return None


def _limit(design: Design, form: str, law: Mechanics, rows: Sequence[Row]) -> Row:
    """The range of c, about the design's own, in which readings are unique, and what happens just outside.

    An end is None where the scan ends before. If the readings are not unique at the c nearest the design's, what
    happens there is under "below".
    """
    found = {"magnet_height_mm": design.magnet_height, "l0_mm": design.l0, "readings": form}
    own = min(range(len(rows)), key=lambda k: abs(rows[k]["c_mm"] - design.c), default=None)
    if own is None or rows[own]["alike_percent"]:
        here = None if own is None else rows[own]
        nothing = dict.fromkeys(("unique_from_c_mm", "unique_to_c_mm", "above"))
        return found | {"unique": False, "below": here} | nothing
    ends: dict[str, Any] = {}
    for name, side, way in (("from", "below", -1), ("to", "above", 1)):
        k = own
        while 0 <= k < len(rows) and not rows[k]["alike_percent"]:
            k += way
        good, bad = (rows[k - way], rows[k]) if 0 <= k < len(rows) else (None, None)
        for _ in range(BISECTIONS if good and bad else 0):
            middle = _at(design, form, law, (good["c_mm"] + bad["c_mm"]) / 2)  # type: ignore[index]
            if middle is None:
                break
            good, bad = (good, middle) if middle["alike_percent"] else (middle, bad)
        ends |= {f"unique_{name}_c_mm": good and good["c_mm"], side: bad}
    return found | {"unique": True} | ends
