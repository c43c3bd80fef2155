"""What the tables of a comparison say: figures, and sentences made from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from analytic import beam, hall
from geometry.design import Design
from geometry.loads import Load
from studies.sensing.field_readings import columns

Row = Mapping[str, Any]
Span = tuple[float, float]

NAN = math.nan


# Figures


def findings(design: Design, press: Sequence[Row], shear: Sequence[Row]) -> dict[str, Any]:
    """Figures from the rows of `compare.run`, NaN or empty where rows give none, and the sentences they make.

    Spans are pairs (first, last) of neighbouring depths of the table, mm. A "worst" figure is the one of largest
    magnitude, beside the depth or shear where it occurs.
    """
    names, unit = columns(design)
    found: dict[str, Any] = {"depths_mm": [row["depth_mm"] for row in press], "elements": names, "output": unit}
    for beam_name, prefix in (("homogeneous", "homogeneous_"), ("rigid", "")):
        for bound in (5, 10):
            key = f"{beam_name}_within_{bound}_percent_mm"
            found[key] = spans(press, "depth_mm", f"{prefix}force_error_percent", bound)
        found |= _worst(press, f"{prefix}force_error_percent", "depth_mm")
    for name in ("shift_error_percent", *(f"analytic_{name}_error_percent_FS" for name in names[:2])):
        found |= _worst(press, name, "depth_mm")
    found |= _output_against_force(design, press, f"{names[0]}_{unit}")
    found |= _secant(design, [row["depth_mm"] for row in press])
    found |= _shear_figures(design, shear, names)
    for label, rows in (("press", press), ("shear", shear)):
        estimates = [row[name] for row in rows for name in ("error_estimate", "homogeneous_error_estimate")]
        found[f"{label}_error_estimate_percent"] = 100 * max(filter(math.isfinite, estimates), default=NAN)
    found["missing_states"] = sum(row["status"] != "ok" for row in (*press, *shear))
    found["warnings"] = design.warnings()
    found["sentences"] = [*press_sentences(found), *shear_sentences(found), *trust_sentences(found)]
    return found


def spans(rows: Sequence[Row], along: str, error: str, bound: float) -> list[Span]:
    """Where an error stays within a bound, in %: runs of neighbouring rows.

    >>> rows = [{"d": 1.0, "e": -9.0}, {"d": 2.0, "e": 4.0}, {"d": 3.0, "e": 1.0}]
    >>> spans(rows, "d", "e", 5)
    [(2.0, 3.0)]
    """
    found: list[Span] = []
    inside = False
    for row in rows:
        fits = abs(row[error]) <= bound
        if fits:
            found.append((found.pop()[0] if inside else row[along], row[along]))
        inside = fits
    return found


def _worst(rows: Sequence[Row], name: str, along: str, key: str = "") -> dict[str, float]:
    finite = [row for row in rows if math.isfinite(row[name])]
    row = max(finite, key=lambda row: abs(row[name]), default={name: NAN, along: NAN})
    return {f"worst_{key or name}": row[name], f"worst_{key or name}_at_mm": row[along]}


def _output_against_force(design: Design, press: Sequence[Row], output: str) -> dict[str, float]:
    """The paper's own test: the output of S1 at equal force, errors in % of its largest change in the FEM."""
    names = ("fem_force_N", f"fem_{output}", "analytic_force_N", f"analytic_{output}")
    rows = [row for row in press if all(math.isfinite(row[name]) for name in names)]
    result = {f"{output}_against_force_error_percent_FS": NAN, f"{output}_against_force_up_to_N": NAN}
    if not rows:
        return result
    import numpy as np

    rest = hall.readings(design).output[0] * (1e3 if output.endswith("mT") else 1.0)
    force, seen, model_force, model_seen = (np.array([row[name] for row in rows]) for name in names)
    shared = force <= model_force.max()
    if not shared.any() or seen[-1] == rest:
        return result
    at_equal_force = np.interp(force[shared], np.append(0.0, model_force), np.append(rest, model_seen))
    error = 100 * (at_equal_force - seen[shared]) / np.abs(seen - rest).max()
    result[f"{output}_against_force_error_percent_FS"] = float(error[np.abs(error).argmax()])
    result[f"{output}_against_force_up_to_N"] = float(force[shared].max())
    return result


def _secant(design: Design, depths: Sequence[float]) -> dict[str, float]:
    """Force (5) with (7) at the deepest depth it reaches, as printed and as a tangent; area over Hertz's there."""
    deepest = max((depth for depth in depths if 0 < depth <= design.R), default=NAN)
    if not deepest > 0:
        return {"secant_depth_mm": NAN, "secant_force_N": NAN, "tangent_force_N": NAN, "area_over_hertz": NAN}
    tangent = design.E * math.pi / design.L * (design.D * deepest**2 / 2 - deepest**3 / 3)
    return {
        "secant_depth_mm": deepest,
        "secant_force_N": beam.solve(design, Load(depth=deepest)).force[2],
        "tangent_force_N": tangent,
        "area_over_hertz": 2 - deepest / design.R,
    }


def _shear_figures(design: Design, shear: Sequence[Row], elements: Sequence[str]) -> dict[str, float]:
    forces = ("fem_force_x_N", "fem_homogeneous_force_x_N")
    moved = [row for row in shear if row["shear_mm"] and all(math.isfinite(row[name]) for name in forces)]
    found = {"shear_depth_mm": shear[0]["depth_mm"] if shear else NAN}
    found["shear_stiffness_N_per_mm"] = beam.shear_stiffness(design)
    for label, row in zip(("first", "last"), (moved[0], moved[-1]) if moved else (), strict=False):
        way = row["shear_mm"]
        found[f"{label}_shear_mm"] = way
        for model in ("fem", "fem_homogeneous"):
            found[f"{model}_{label}_stiffness_N_per_mm"] = row[f"{model}_force_x_N"] / way
            found[f"{model}_{label}_tilt_deg_per_mm"] = math.degrees(row[f"{model}_tilt_rad"]) / way
            found[f"{model}_{label}_shift_per_mm"] = row[f"{model}_shift_x_mm"] / way
        found["analytic_shift_per_mm"] = row["analytic_shift_x_mm"] / way
    for name in ("force_x_error_percent", "homogeneous_force_x_error_percent"):
        found |= _worst(moved, name, "shear_mm")
    for model in ("untilted", "analytic"):
        for element in elements:
            name = f"{model}_{element}_error_percent_FS"
            found |= _worst(shear, name, "shear_mm", f"shear_{name}")
    return found


# Sentences


def press_sentences(found: Row) -> list[str]:
    """What the press shows."""
    lines = []
    for name, text in (("homogeneous", "of a beam that is all silicone"), ("rigid", "with the rigid magnet inside")):
        five, ten = (found[f"{name}_within_{bound}_percent_mm"] for bound in (5, 10))
        prefix = "homogeneous_" if name == "homogeneous" else ""
        worst = found[f"worst_{prefix}force_error_percent"]
        if not math.isfinite(worst):
            lines.append(f"Press force {text}: no depth to compare.")
            continue
        at = found[f"worst_{prefix}force_error_percent_at_mm"]
        held = f"within 5 % of the finite elements {_where(five, found)}, and within 10 % {_where(ten, found)}"
        lines.append(
            f"Press force {text}: the paper's F(d) is {held if ten else 'never within 10 % of the finite elements'}; "
            f"its worst error is {worst:+.0f} %, at {at:.3g} mm."
        )
    worst, at = (found[f"worst_shift_error_percent{end}"] for end in ("", "_at_mm"))
    if math.isfinite(worst):
        why = (
            ": a uniform bar spreads the compression evenly, a round tip takes most of it itself" if worst > 0 else ""
        )
        lines.append(
            f"Sinking of the magnet: the paper's figure is off by up to {worst:+.0f} % (at {at:.3g} mm){why}."
        )
    first, second, third = found["elements"]
    errors = [found[f"worst_analytic_{name}_error_percent_FS"] for name in (first, second)]
    if math.isfinite(errors[0]):
        lines.append(
            f"Readings at equal depth: off by up to {errors[0]:+.0f} % of full scale in {_words(first)} and "
            f"{errors[1]:+.0f} % in {_words(second)} and {_words(third)}."
        )
    output = f"{first}_{found['output']}"
    worst = found[f"{output}_against_force_error_percent_FS"]
    if math.isfinite(worst):
        volts = found["output"] == "V"
        what = "Voltage of S1" if volts else f"Output of {_words(first)}"
        lines.append(
            f"{what} at equal force (the paper reports less than 5 %{'' if volts else ' of its S1'}), up to "
            f"{found[f'{output}_against_force_up_to_N']:.3g} N: off by up to {worst:+.0f} % of full scale; "
            f"{'this agrees with the paper.' if abs(worst) < 5 else 'the finite elements do not confirm the claim.'}"
        )
    if math.isfinite(found["secant_force_N"]):
        lines.append(
            f"Formula (5) with (7) is a secant law: at {found['secant_depth_mm']:.3g} mm it gives "
            f"{found['secant_force_N']:.2f} N, while the same stiffness taken as a tangent gives "
            f"{found['tangent_force_N']:.2f} N. Its contact area (7) is twice Hertz's at first touch and "
            f"{found['area_over_hertz']:.2f} times at that depth."
        )
    return lines


def shear_sentences(found: Row) -> list[str]:
    """What the sheared press shows."""
    if not math.isfinite(found.get("fem_first_stiffness_N_per_mm", NAN)):
        return ["Shear: the finite elements reached no state to compare."]
    stiff, bare = (found[f"{model}_first_stiffness_N_per_mm"] for model in ("fem", "fem_homogeneous"))
    worst, at = (found[f"worst_force_x_error_percent{end}"] for end in ("", "_at_mm"))
    shift, tilt = (found[f"fem_first_{name}_per_mm"] for name in ("shift", "tilt_deg"))
    lines = []
    lines.append(
        f"Shear stiffness, plate stuck to a tip pressed by {found['shear_depth_mm']:.3g} mm: the paper's 3EI/L³ is "
        f"{found['shear_stiffness_N_per_mm']:.3f} N/mm; the finite elements give {stiff:.3f} N/mm with the rigid "
        f"magnet and {bare:.3f} N/mm all silicone, over the first {found['first_shear_mm']:.3g} mm. Against the "
        f"former, the paper's shear force is off by up to {worst:+.0f} % (at {at:.3g} mm)."
    )
    lines.append(
        f"For each mm of shear the magnet moves sideways by {shift:.2f} mm (paper: "
        f"{found['analytic_shift_per_mm']:.2f} mm) and tilts by {tilt:.1f}° (paper: 0°)."
    )
    tilted, whole = (
        [found[f"worst_shear_{model}_{name}_error_percent_FS"] for name in found["elements"]]
        for model in ("untilted", "analytic")
    )
    if all(math.isfinite(value) for value in (*tilted, *whole)):
        guilty = max(map(abs, tilted)) >= 0.5 * max(map(abs, whole))
        elements = ", ".join(map(_words, found["elements"]))
        lines.append(
            f"Readings of {elements}: off by up to {_list(whole)} % of full scale. With the finite elements' "
            f"position of the magnet but without its tilt they are still off by up to {_list(tilted)} %: the tilt "
            f"{'explains most of' if guilty else 'alone does not explain'} the paper's error"
            f"{'.' if guilty else '; the wrong position of the magnet weighs more.'}"
        )
    return lines


def trust_sentences(found: Row) -> list[str]:
    """How far the finite elements themselves can be trusted."""
    lines = []
    if math.isfinite(found["press_error_estimate_percent"]):
        lines.append(
            "Press: judged by a coarser mesh, the force is uncertain by at most "
            f"{found['press_error_estimate_percent']:.1f} %."
        )
    if math.isfinite(found["shear_error_estimate_percent"]):
        lines.append(
            "Shear: judged by a coarser mesh with one harmonic less, the force is uncertain by at most "
            f"{found['shear_error_estimate_percent']:.1f} %."
        )
    missing = found["missing_states"]
    lines.append(
        f"{missing} state{'s were' if missing > 1 else ' was'} not reached; the table says why."
        if missing
        else "Every state asked for was reached."
    )
    return lines


def _words(element: str) -> str:
    return element.replace("_", " ")


def _where(found: Sequence[Span], figures: Row) -> str:
    depths = figures["depths_mm"]
    if not found:
        return "at none of the depths"
    if list(found) == [(depths[0], depths[-1])]:
        return f"at all depths ({depths[0]:.3g} to {depths[-1]:.3g} mm)"
    return "at " + " and ".join(f"{a:.3g} mm" if a == b else f"{a:.3g} to {b:.3g} mm" for a, b in found)


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:+.0f}" for value in values)
