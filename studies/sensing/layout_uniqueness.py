"""The paper's claim that readings are unique to each position of the magnet, tested numerically."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import brentq

from analytic import decode, parts, survey
from analytic.decode import Decoder
from analytic.hall import Mode
from analytic.inverse.response_surface import Mechanics
from analytic.magnet import cylinder_field
from analytic.survey import Survey
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.output.records import FlatRow
from studies.sensing import decode_readings

FORMS: dict[str, tuple[Mode, str, bool]] = {
    "|B|, no tilt (the paper's)": ("magnitude", "paper", True),
    "B.n, no tilt": ("component", "paper", True),
    "B.n, tilt": ("component", "finite", False),
}
"""For each form of the readings: mode, level of the mechanics, and whether the decoder ignores the tilt."""
HEIGHTS = (1.0, 1.5, 2.0)
"""Heights of the magnet over that of the design."""
STEP, BISECTIONS = 1 / 16, 3
"""Step of c over D, and number of bisections: the limit of c is found to an eighth of the step."""
POSES = (13, 13, 7)
APART = (1 / 800, 1 / 80, 1 / 8)
"""Distances between poses, over D, at which readings are compared."""
WIDE = 1e6
"""Rails of the elements' outputs that no field reaches, so that no pose is saturated."""
Claim = Mapping[str, list["FlatRow"]]
"""Rows of the answer: `forms`, one for each form of the readings, for the design's own layout; `limits`, the range of
c in which each form is unique; `heights`, one for each c.

A form and a height have the figures of `alike_figures`, a form also the least differences of the readings. A limit
has the ends of the range of c about the design's own, None where the scan ends before, and the rows just outside,
below and above; if the readings are not unique at the c nearest the design's, what happens there is `below`."""
DIFFERENCE = re.compile(r"difference_at_(\S+)_mm_over_noise")
"""Columns of the least difference in the readings, over their noise, of two poses that are at least so far apart."""


def run(design: Design, progress: Progress) -> Claim:
    """Test the claim for the design's own layout, and for other heights of the magnet and of S2 and S3."""
    check(design)
    claim: dict[str, list[FlatRow]] = {"forms": [], "limits": [], "heights": []}
    for k, form in enumerate(FORMS):
        progress(0.2 * k / len(FORMS), "the claim: the given layout")
        claim["forms"].append(_own(design, form))
    work = [(magnet, form) for magnet in _magnets(design) for form in FORMS]
    for k, (magnet, form) in enumerate(work):
        progress(0.2 + 0.8 * k / len(work), f"the claim: magnet {magnet.magnet_height:g} mm high")
        law = law_of(magnet, form)
        step = STEP * magnet.D
        # c from 0 to the height of the magnet's centre at rest
        every = (_at(magnet, form, law, n * step) for n in range(round(magnet.l0 / step)))
        rows = [row for row in every if row is not None]
        claim["heights"] += rows
        claim["limits"].append(_limit(magnet, form, law, rows))
    progress(1.0, "the claim")
    return claim


def check(design: Design) -> None:
    """Refuse a design to which the claim does not apply."""
    if design.hall_layout != "three":
        raise BadInput("the claim is about three elements: give hall_layout=three, or leave --claim out")


def answer(claim: Claim) -> list[str]:
    """Return the answer to the claim in sentences: for the design's layout, and over c."""
    height = claim["limits"][0]["magnet_height_mm"]
    given = [limit for limit in claim["limits"] if limit["magnet_height_mm"] == height]
    heights = [row for row in claim["heights"] if row["magnet_height_mm"] == height]
    worst = [
        max((row for row in heights if row["readings"] == limit["readings"]), key=lambda row: row["alike_percent"])
        for limit in given
    ]
    return decode_readings.sentences(
        "claim",
        claim=claim,
        differences=differences,
        given=list(zip(given, worst, strict=True)),
        taller=[limit for limit in claim["limits"] if limit["magnet_height_mm"] != height],
    )


def differences(row: FlatRow) -> dict[str, float]:
    """Return the least differences in the readings, over their noise, by the distance of the poses, mm."""
    return {match[1]: value for name, value in row.items() if (match := DIFFERENCE.fullmatch(name))}


def law_of(design: Design, form: str) -> Mechanics:
    """Return the mechanics of a form of the readings; they do not depend on the layout."""
    return decode_readings.of_level(design, FORMS[form][1])


def coder_of(design: Design, form: str, law: Mechanics) -> Decoder:
    """Return the decoder of a form of the readings, without rails."""
    mode, _, ignored = FORMS[form]
    elements, _ = parts.with_noise(parts.of_design(design))
    open_ = [dataclasses.replace(e, low=-WIDE, high=WIDE) for e in elements]
    return decode.decoder(design, law, ignore_tilt=ignored, elements=open_, mode=mode)


def alike_figures(design: Design, form: str) -> FlatRow:
    """Return which share of the poses reads alike, and where: least and largest shift along each axis, mm."""
    return _figures(survey.survey(coder_of(design, form, law_of(design, form)), POSES))


def _magnets(design: Design) -> Iterator[Design]:
    """Yield the design and its variants with taller magnets; l0 keeps the reading of S1 at rest."""

    def at_rest(height: float, l0: float) -> float:
        point = np.array([[0.0, 0.0, l0]])
        return float(cylinder_field(point, design.magnet_diameter / 2, height, design.remanence_now)[0, 2])

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


def _own(design: Design, form: str) -> FlatRow:
    coder = coder_of(design, form, law_of(design, form))
    poses = survey.survey(coder, POSES)
    row = {"readings": form, **_figures(poses), "workspace_mm": [coder.low.tolist(), coder.high.tolist()]}
    for apart in (share * design.D for share in APART):
        least = 0.0 if row["alike_percent"] else survey.least_difference(coder, poses, apart)
        row[f"difference_at_{apart:.2g}_mm_over_noise"] = least
    return row


def _figures(poses: Survey) -> FlatRow:
    many = (poses.multiplicity > 1) & (poses.weight > 0)
    known = poses.weight > 0
    box = [[float(v[many].min()), float(v[many].max())] for v in poses.shift] if many.any() else [None] * 3
    folds = min(poses.share(poses.sign > 0), poses.share(poses.sign < 0))
    return {
        "unique_percent": 100 * poses.share(poses.multiplicity == 1),
        "alike_percent": 100 * poses.share(many),
        "rarer_det_percent": 100 * folds,
        "alike_apart_mm": float(poses.alike_mm[many].max(initial=0.0)),
        "alike_x_mm": box[0],
        "alike_y_mm": box[1],
        "alike_z_mm": box[2],
        "blocked_percent": 100 * poses.share(poses.blocked),
        "condition_worst": float(np.max(poses.condition[known])) if not folds else np.inf,
    }


def _at(design: Design, form: str, law: Mechanics, c: float) -> FlatRow | None:
    changed = dataclasses.replace(design, c=c)
    try:
        figures = _figures(survey.survey(coder_of(changed, form, law), POSES))
    except BadInput:
        return None
    place = {"magnet_height_mm": design.magnet_height, "l0_mm": design.l0, "c_mm": c, "readings": form}
    return place | figures


def _limit(design: Design, form: str, law: Mechanics, rows: Sequence[FlatRow]) -> FlatRow:
    nearest = min(range(len(rows)), key=lambda k: abs(rows[k]["c_mm"] - design.c), default=None)
    unique = nearest is not None and not rows[nearest]["alike_percent"]
    ends: list[tuple[float | None, FlatRow | None]] = [(None, None), (None, None)]
    if nearest is not None and not unique:
        ends[0] = None, rows[nearest]
    elif nearest is not None:
        for end, step in enumerate((-1, 1)):
            k = nearest
            while 0 <= k < len(rows) and not rows[k]["alike_percent"]:
                k += step
            if 0 <= k < len(rows):
                ends[end] = _bisected(design, form, law, rows[k - step], rows[k])
    (low, below), (high, above) = ends
    return {
        "magnet_height_mm": design.magnet_height,
        "l0_mm": design.l0,
        "readings": form,
        "unique": unique,
        "unique_from_c_mm": low,
        "below": below,
        "unique_to_c_mm": high,
        "above": above,
    }


def _bisected(design: Design, form: str, law: Mechanics, good: FlatRow, bad: FlatRow) -> tuple[float, FlatRow]:
    """Bisect between a c with unique readings and one without; return the last c with, and the row without."""
    for _ in range(BISECTIONS):
        middle = _at(design, form, law, (good["c_mm"] + bad["c_mm"]) / 2)
        if middle is None:
            break
        good, bad = (good, middle) if middle["alike_percent"] else (middle, bad)
    return good["c_mm"], bad
