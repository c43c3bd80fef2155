"""What `magtip fit` finds: laws of a uniaxial test, or branches of a relaxation or dynamic test, and a design file.

`laws` ranks the laws (`law_regression`), and `branches` the numbers of Prony branches (`branch_regression`). A law or
a number of branches is a record; fit.csv has its lists as texts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import SILICONE_E, BadInput, Design
from geometry.messages import Progress
from geometry.relaxation import branches_text, range_text
from studies.output.atomic_files import write_text
from studies.output.figures import FREE, LOG, Figure, markers, rule, save, styles
from studies.output.literals import one_line, toml
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table
from studies.quantities import shown
from studies.simulation import branch_regression, law_regression, material_tests
from studies.simulation.branch_regression import BranchFit, thinned
from studies.simulation.law_regression import MISFIT, Fit, nominal_stress
from studies.simulation.material_tests import Specimen, Test

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd

FILES = ("fit.csv", "fit.png", "design.toml")
"""Files of a fit."""
STILL_FALLING = 3.0
"""A branch longer than the longest time over this has not relaxed by the end of the test."""
WRONG = 0.05
"""Rms residual from which on branches do not describe the test, and are no design."""
AT_START = 1.02
"""Ratio of the shortest branch to the first time up to which it lies at the bound of the fit."""
Curve = tuple[Array, NDArray[Any]]
"""Stretches, times or frequencies, and values at these, shape (n,) each."""


def _texts(record: FlatRow) -> FlatRow:
    def text(name: str, value: Any) -> Any:
        if isinstance(value, dict):
            return ", ".join(f"{key}={shown(number, digits=6)}" for key, number in value.items())
        if not isinstance(value, list):
            return value
        if name.startswith("stable_"):
            return "{:.3g} to {:.3g}".format(*value)
        return shown(value, digits=6)

    return {name: text(name, value) for name, value in record.items() if name != "warnings"}


def _design_file(path: str, rms: str, command: str, lines: Sequence[str]) -> str:
    head = [f"# fitted to {Path(path).name}: rms residual {rms}", f"# by {command}"]
    # a comment cannot contain the end of a line, which the name of a file can
    return "\n".join([*map(one_line, head), *lines, ""])


# Laws of a uniaxial test


def laws(path: str, nu: float, asked: str | None, command: str, progress: Progress, *, wide: bool = False) -> Result:
    """Fit all laws to the uniaxial test in a file, the best first; at most one is chosen, and is in design.toml.

    asked, command : the law that the user chooses, and the command line that design.toml names as its origin.
    """
    data = material_tests.read_specimen(path)
    progress(0.0, "fits of all laws")
    fits = law_regression.fit(data, nu)
    records = law_regression.choose(fits, data, asked)
    texts = [_texts(record) for record in records]
    chosen = [record for record in records if record["chosen"]]
    said = [f"{reason}." for reason in map(law_regression.reasons, records) if reason]
    lost = (
        "no law is chosen and no design.toml written: every fitted E is outside the range of a design, or the law "
        f"misses the test by more than {100 * law_regression.WRONG:g} % of the largest stress"
    )
    files = {"fit.png": partial(_draw_laws, data=data, fits=fits, nu=nu)}
    for each in chosen:
        values = {"E": each["E_MPa"], "nu": nu, "law": each["law"], **each["numbers"]}
        lines = toml(values)
        rms = f"{each['rms_percent']:.3g} % of the largest stress"
        files["design.toml"] = partial(write_text, text=_design_file(path, rms, command, lines))
    return Result(
        title="Laws",
        records=records,
        shown=[*_law_tables(texts, wide=wide), *said],
        tables={"fit": texts},
        files=files,
        warnings=[text for each in chosen or records for text in each["warnings"]],
        failures=[] if chosen else [lost],
    )


def _law_tables(rows: Sequence[FlatRow], *, wide: bool) -> list[Block]:
    by_AICc = rows[0]["ranked_by"] == "AICc"
    ranking = "AICc" if by_AICc else "number of constants (too few points for AICc)"
    title = f"Laws, best first, ranked by {ranking}"
    if wide:
        return [Table(title=title, rows=rows)]
    fits = ("law", "chosen", "AICc", "rms_percent", "small_strain_excess_percent", "E_MPa")
    ranges = ("law", "stable_uniaxial", "stable_equibiaxial", "stable_planar")
    tables: list[Block] = [
        Table(title=name, rows=[{key: row[key] for key in keys} for row in rows])
        for name, keys in ((title, fits), ("Numbers", ("law", "numbers")), ("Stable stretches", ranges))
    ]
    alike = "Laws within 2 of the least AICc count as equally good; those with the fewest constants come first."
    return [*tables, alike] if by_AICc else tables


def _draw_laws(path: Path, data: Specimen, fits: Sequence[Fit], nu: float) -> None:
    smooth = np.geomspace(min(1.0, data.stretch.min()), max(1.0, data.stretch.max()), 300)
    x, y, rest = "stretch", "nominal stress (MPa)", "law less test (% of the largest)"

    def stress(fit: Fit, stretch: Array) -> Array:
        return fit.E / (2 * (1 + nu)) * nominal_stress(fit.law, tuple(fit.numbers.values()), stretch)

    whole = {fit.law: (smooth, stress(fit, smooth)) for fit in fits}
    largest = np.abs(data.stress).max()
    left = {fit.law: (data.stretch, 100 * (stress(fit, data.stretch) - data.stress) / largest) for fit in fits}
    names = ("test", *whole)
    points = _joined(x, y, {"test": (data.stretch, data.stress)}, whole)
    residuals = _joined(x, rest, left, {})
    save(
        path,
        [
            Figure("Uniaxial test and laws", "", _tested(points, x, y, names), points),
            Figure("What the laws leave over", "", _left_over(residuals, x, rest, names), residuals),
        ],
    )


# Branches of a relaxation test or a dynamic test


def branches(
    path: str,
    nu: float,
    stretch: float | None,
    ramp: float | None,
    command: str,
    progress: Progress,
    *,
    wide: bool = False,
) -> Result:
    """Fit Prony branches to the test in a file: a record for each number of branches, the least AICc first.

    If the chosen one has no branches, or an E that a design cannot have, there is no design.toml.
    """
    if not 0.0 <= nu <= 0.5:
        raise BadInput(f"--nu must lie between 0 and 0.5; got {nu:g}")
    test = material_tests.read(path, nu, stretch, ramp)
    progress(0.0, "fits of branches")
    fits, best = branch_regression.fit(thinned(test))
    chosen = fits[best]
    ranked = sorted(fits, key=lambda each: each.aicc)
    records = [branch_record(each, test, rank, chosen=each is chosen) for rank, each in enumerate(ranked, 1)]
    texts = [_texts(record) for record in records]
    files = {"fit.png": partial(_draw_branches, test=test, fit=chosen)}
    tables, unusable = _branch_tables(texts, chosen, test, wide=wide), why_unusable(chosen, test)
    speaks = f"branches speak for {range_text(chosen.relaxation)}"
    if not unusable:
        # E at rest, if it is known
        lines = [f"E = {chosen.long_term:.6g}", f"nu = {nu!r}"] if test.has_modulus else []
        lines += toml({"modulus": "long-term", "prony": branches_text(chosen.relaxation)})
        text = _design_file(path, shown(chosen.rms, "percent"), command, [f"# the {speaks}", *lines])
        files["design.toml"] = partial(write_text, text=text)
        tables += ["Lines for a design file:", *(f"  {line}" for line in lines)]
    if chosen.count:
        tables.append(f"The {speaks}.")
    return Result(
        title="Branches",
        records=records,
        shown=tables,
        tables={"fit": texts},
        files=files,
        warnings=_warnings(chosen, test),
        failures=[f"{unusable}: no design.toml is written"] if unusable else [],
    )


def branch_record(fit: BranchFit, test: Test, rank: int, *, chosen: bool) -> FlatRow:
    """Return the record of one number of branches; E is None where the file has a stress without a stretch."""
    relaxation, warned = fit.relaxation, _warnings(fit, test)
    E = {
        "E_MPa": fit.long_term,
        "E_long_term_MPa": fit.long_term,
        "E_long_term_half_width_MPa": fit.long_term_half_width,
        "E_instantaneous_MPa": fit.instantaneous,
        "E_instantaneous_half_width_MPa": fit.instantaneous_half_width,
    }
    return {
        "rank": rank,
        "test": test.kind,
        "branches": fit.count,
        "chosen": chosen,
        "AICc": fit.aicc,
        "rms_percent": 100 * fit.rms,
        **{name: value if test.has_modulus else None for name, value in E.items()},
        "long_term_share": relaxation.rest,
        "shares": list(relaxation.shares),
        "times_s": list(relaxation.times),
        "covered_s": list(relaxation.speaks_for),
        "covered_Hz": list(relaxation.speaks_for_frequencies),
        "prony": branches_text(relaxation) if fit.count else "",
        "points": len(test.at),
        "ranked_by": "AICc",
        "warnings": warned,
        "warning": "; ".join(warned),
    }


def _branch_tables(rows: Sequence[FlatRow], chosen: BranchFit, test: Test, *, wide: bool) -> list[Block]:
    keys = rows[0] if wide else ("branches", "chosen", "AICc", "rms_percent", "long_term_share")
    title = "Numbers of branches, least AICc first"
    tables: list[Block] = [Table(title=title, rows=[{key: row[key] for key in keys} for row in rows])]
    tables.append("Of the fits within 2 of the least AICc, the one with the fewest branches is chosen.")
    if test.has_modulus:
        moduli = (
            ("long-term", chosen.long_term, chosen.long_term_half_width),
            ("instantaneous", chosen.instantaneous, chosen.instantaneous_half_width),
        )
        moduli_rows = [
            {"modulus": name, "E (MPa)": f"{value:.5g}", "95 %: +- (MPa)": f"{width:.2g}"}
            for name, value, width in moduli
        ]
        tables.append(Table(title="Young's modulus", rows=moduli_rows))
    pairs = zip(chosen.relaxation.shares, chosen.relaxation.times, strict=True)
    if branches := [{"share g": g, "tau_s": tau} for g, tau in pairs]:
        tables.append(Table(title="Branches", rows=branches))
    return tables


def why_unusable(fit: BranchFit, test: Test) -> str:
    """Return why no design can have the branches and the E of a fit, or these do not describe the test; else ""."""
    spec = Design.__dataclass_fields__["E"].metadata
    if not fit.count:
        return "the test has no branches"
    if fit.rms > WRONG:
        return f"the branches miss the test by more than {100 * WRONG:g} %"
    known = not test.has_modulus or spec["low"] <= fit.long_term <= spec["high"]
    return "" if known else "E is outside the range of a design"


def _warnings(fit: BranchFit, test: Test) -> list[str]:
    return law_regression.sentences(
        "branches",
        fit=fit,
        times=fit.relaxation.times,
        test=test,
        silicone=SILICONE_E,
        misfit=MISFIT,
        still_falling=STILL_FALLING,
        at_start=AT_START,
    )


def _draw_branches(path: Path, test: Test, fit: BranchFit) -> None:
    smooth = np.geomspace(test.at[0], test.at[-1], 400)
    curve, at_points = (branch_regression.model(each, fit) for each in (replace(test, at=smooth), test))
    save(path, branch_figures(test, (smooth, curve), at_points))


PARTS = {"storage": np.real, "loss": np.imag}


def branch_figures(test: Test, curve: Curve, at_points: NDArray[Any]) -> list[Figure]:
    """Return the figures of a test and of E(t), or E' + i E'', MPa, along a smooth curve and at the test's points."""
    unit = "(MPa)" if test.has_modulus else "(MPa, nominal)"
    smooth, fitted = curve
    if test.kind == "dynamic":
        x, y, loss = "frequency (Hz)", f"modulus {unit}", "loss factor"
        points = {f"{name}, test": (test.at, part(test.values)) for name, part in PARTS.items()}
        lines = {f"{name}, fit": (smooth, part(fitted)) for name, part in PARTS.items()}
        factors = {"test": (test.at, test.values.imag / test.values.real)}
        data = _joined(x, loss, factors, {"fit": (smooth, fitted.imag / fitted.real)})
        moduli = _joined(x, y, points, lines)
        return [
            Figure("Moduli of the test and of the branches", "", _tested(moduli, x, y, logarithmic="xy"), moduli),
            Figure("Loss factor", "", _tested(data, x, loss, logarithmic="x"), data),
        ]
    x, y = "time (s)", f"{'modulus E(t)' if test.has_modulus else 'stress'} {unit}"
    rest = "fit less test (% of the largest)"
    left = {"fit": (test.at, 100 * (at_points - test.values) / test.values.max())}
    data, residuals = _joined(x, y, {"test": (test.at, test.values)}, {"fit": curve}), _joined(x, rest, left, {})
    chart = _left_over(residuals, x, rest, ("test", "fit"), logarithmic="x")
    return [
        Figure("Relaxation of the test and of the branches", "", _tested(data, x, y, logarithmic="x"), data),
        Figure("What the branches leave over", "", chart, residuals),
    ]


def _tested(data: pd.DataFrame, x: str, y: str, names: Sequence[str] = (), logarithmic: str = "") -> alt.LayerChart:
    """Return the points of a test and the lines of what was fitted to it."""
    import altair as alt

    names, lines = names or list(data["series"]), set(data["series"][data["joined"]])
    across, up = (LOG if way in logarithmic else FREE for way in "xy")
    base = alt.Chart(data).encode(x=alt.X(x, **across), y=alt.Y(y, **up))
    curves = base.transform_filter("datum.joined").mark_line().encode(**styles(names, "color"))
    points = base.transform_filter("!datum.joined").mark_point()
    return curves + points.encode(**styles(names, lines=lines))


def _left_over(data: pd.DataFrame, x: str, y: str, names: Sequence[str], logarithmic: str = "") -> alt.LayerChart:
    """Return what is left over at the points of a test, with a line at zero."""
    import altair as alt

    across = alt.X(x, **(LOG if logarithmic else FREE))
    lines = alt.Chart().mark_line(point=markers(data)).encode(x=across, y=y, **styles(names))
    return alt.layer(*rule("y", 0.0), lines, data=data)


def _joined(x: str, y: str, points: Mapping[str, Curve], lines: Mapping[str, Curve]) -> pd.DataFrame:
    """Return points and lines by their names as the table of a plot; without lines the points are joined, too."""
    import pandas as pd

    parts = [
        pd.DataFrame({x: at, y: values}).assign(series=name, joined=line)
        for line, curves in ((False, points), (True, lines))
        for name, (at, values) in curves.items()
    ]
    data = pd.concat(parts, ignore_index=True)
    return data if lines else data.drop(columns="joined")
