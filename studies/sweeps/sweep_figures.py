"""Figures of a sweep's table: quantities over its axes by all models, with their errors, for picture and page.

What a column is, an axis or an answer of a model, the study says (`studies.answers.SweepColumns`), and what is drawn
of a quantity its parts (`studies.quantities`). The longest axis of numbers is horizontal, the next one has colours,
or is the vertical axis of maps if it has many values; up to two more make panels. Axes without effect are named, and
what would need too many panels is shown by its extremes. Each model has markers and dashes, or maps, of its own.
Sampled points are shown over each axis. Of a study with more than some ten thousand cases every k-th value of its
longest axes is drawn, and a note says so.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.loads import ANSWERED
from studies.answers import SweepColumns
from studies.inputs import study_input
from studies.mechanics.path_solver import KINDS
from studies.mechanics.study_cases import Columns, Plan
from studies.output import figures
from studies.output.figures import SHADES, Figure, bands, panels, thinned
from studies.output.maps import ERROR_EDGES, WIDE, heat, spots
from studies.output.text_tables import name_and_unit, quantity_name
from studies.quantities import UNITS, Part, drawn_parts, shown
from studies.sweeps.answer_curves import Axes, curves, drawable

if TYPE_CHECKING:
    import pandas as pd

MOST_COLOURS = 6
"""Greatest number of values of an axis that are told apart by colours."""
MOST_PANELS = 12
ERROR = "error (%)"
"""Label of errors of models."""
SAME = 1e-6
"""Relative difference up to which two results are the same, because scaled results have rounding errors."""
SAME_RATIO = 0.15
"""Relative spread of the ratios of neighbouring values up to which they are log-spaced; 1, 2, 5, 10 is beyond it."""
LEAST_RATIO = 8.0
"""Ratio of the last to the first value from which a logarithmic axis is of use."""
BEYOND = 5.0
"""Ratio to the error that 90 % of the cases do not exceed beyond which a plot does not show errors."""
BINS = 8
"""Number of parts of an axis between whose means the effect of the axis is measured."""
MOST_NOTED = 100
"""Number of letters beyond which the reason of failed cases is not continued by its next clause."""


class View(NamedTuple):
    """What each axis does: horizontal, colours (or vertical in maps), panels, or shown by its extremes (folded)."""

    x: str
    second: str = ""
    panels: tuple[str, ...] = ()
    folded: tuple[str, ...] = ()
    maps: bool = False


def sweep(table: pd.DataFrame, study: SweepColumns, quantities: Sequence[str] = ()) -> list[Figure]:
    """Return the figures of rows of sweep.csv, those of a quantity and of its errors one after the other."""
    axes = [name for name in study.axes if table[name].nunique() > 1] or list(study.axes[:1])
    if not axes or not len(table):
        return []
    table, axes, notes = _grouped_axes(table, axes)
    draw = _scattered if is_sampled(table, axes) else _over_grid
    drawn = [each for name in quantities or drawn_parts() for each in draw(table, axes, study, drawn_parts()[name])]
    return [replace(each, notes=(*each.notes, *notes, *failures(table))) for each in drawn[:1]] + drawn[1:]


def drawn_quantities(study: SweepColumns, table: pd.DataFrame) -> list[str]:
    """Return the quantities that figures show of a table."""
    return [name for name in drawn_parts() if study.answers(name, table.columns)]


def is_sampled(table: pd.DataFrame, axes: Sequence[str]) -> bool:
    """Return whether the points fill the space of the axes without a grid."""
    return len(table) > 8 and all(table[name].nunique() > 0.5 * len(table) for name in axes) and len(axes) > 1


# What is drawn: a row for each model and case


def answers(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, quantity: str) -> pd.DataFrame:
    """Return the answers of all models to a quantity, a row for each model and case, model after model.

    Columns are the axes, the model's name, the `value` (NaN where the model failed), whether it `failed`, whether
    the state is not known to be stable (`open`), and the depth at which the press buckles (`limit`), where known.
    """
    parts = []
    for model, column in study.answers(quantity, table.columns).items():
        failed, doubted = _verdicts(table, study, model)
        # a formula knows no stability
        doubted &= study.kind(model).states_errors
        parts.append((study.title(model), table[column], failed, doubted))
    return _tidy(table, axes, parts)


def errors(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, part: Part) -> pd.DataFrame:
    """Return the errors of all models against the reference as `answers` does; the reference says what is stable."""
    failed, doubted = _verdicts(table, study, study.reference)
    gave_way = table["error_status"] == "gave_way" if "error_status" in table else failed & False
    found = study.errors(part.error_column, table.columns)
    parts = [
        (study.title(model), table[name], failed | gave_way | _verdicts(table, study, model)[0], doubted)
        for model, name in found.items()
    ]
    return _tidy(table.assign(gave_way=gave_way), [*axes, "gave_way"], parts)


def _tidy(table: pd.DataFrame, columns: Sequence[str], models: Sequence[tuple[str, Any, Any, Any]]) -> pd.DataFrame:
    """Return the rows of models: their titles, values, where they failed, and where stability is not known."""
    import pandas as pd

    shared = table[list(columns)]
    if "critical_depth_mm" in table:
        over = table["D_mm"] if "depth_over_D" in columns else 1.0
        shared = shared.assign(limit=table["critical_depth_mm"] / over)
    parts = [
        shared.assign(model=title, value=value.where(~failed), failed=failed, open=doubted & ~failed & value.notna())
        for title, value, failed, doubted in models
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({"model": [], "value": []})


def _verdicts(table: pd.DataFrame, study: SweepColumns, model: str) -> tuple[pd.Series, pd.Series]:
    """Return where a model has no answer, and where its state is not known to be stable; of "" that of the row."""
    own = study.status(model)
    status = table[own if own in table else "status"]
    answered = status.isin(ANSWERED)
    # the search for a critical depth may doubt a state of the reference
    later = table["status"].isin(ANSWERED) & (table["status"] != "ok") & (model in ("", study.reference))
    return ~answered, answered & ((status != "ok") | later)


# Words


def value_of(column: str, value: Any, D: float | None = None) -> str:
    """Return a value of an axis with its name, of L and depth also over a diameter D, mm.

    >>> value_of("L_mm", 9.0), value_of("L_mm", 9.0, 6.0), value_of("L_over_D", 1.5, 6.0)
    ('L = 9 mm', 'L = 9 mm (L/D = 1.5)', 'L/D = 1.5')
    """
    if isinstance(value, str) and " = " in value:  # axes that vary together have their names in their values
        return value
    name, unit = name_and_unit(column)
    over = f" ({name}/D = {value / D:.3g})" if D is not None and column in ("L_mm", "depth_mm", "shear_mm") else ""
    return f"{name} = {shown(value, digits=4)} {unit}".strip() + over


def in_words(column: str) -> str:
    """Return the name of an axis without its unit."""
    return name_and_unit(column)[0]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _list(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def failures(table: pd.DataFrame) -> list[str]:
    """State in a sentence how many cases failed and why."""
    lost = table[~table["status"].isin(ANSWERED)]
    if not len(lost):
        return []
    kinds = Counter(lost["status"]).most_common(3)
    causes = ", ".join(f"{count} {status}" if len(kinds) > 1 else status for status, count in kinds)
    text = f"{len(lost)} of {len(table)} cases failed ({causes})"
    reasons = Counter(message for message in lost.get("message", ()) if isinstance(message, str) and message)
    for reason, _ in reasons.most_common(1):
        while len(reason) > MOST_NOTED and "; " in reason:
            reason = reason.rpartition("; ")[0]
        # a long clause ends with a colon and the remedy
        text += f"; most often: {reason if len(reason) <= MOST_NOTED else reason.rpartition(': ')[0] or reason}"
    return [text.rstrip(".") + "."]


def unanswered(tidy: pd.DataFrame) -> list[str]:
    """State in how many cases a model has no answer that another one has."""
    lost = tidy.groupby("model", sort=False)["failed"].sum()
    if lost.min() == lost.max():
        return []
    of = len(tidy) // len(lost)
    named = [f"{name} in {count if count < of else 'all'}" for name, count in lost.items() if count > lost.min()]
    marked = " (crosses)" if ((lost > lost.min()) & (lost < of)).any() else ""
    return [f"Without an answer{marked}: {'; '.join(named)} of {of} cases."]


def marked(tidy: pd.DataFrame, *, maps: bool) -> list[str]:
    """Return what the marks of a figure mean, with the numbers of cases, which each model has once."""
    cases, said = tidy.groupby("model", sort=False), []
    if count := int(cases["open"].sum().max()):
        what = f"{'Dots' if maps else 'Open markers'}: {'1 case is' if count == 1 else f'{count} cases are'}"
        said.append(f"{what} unstable, or not known to be stable; a real sensor may leave such a state.")
    if "gave_way" in tidy and (count := int(cases["gave_way"].sum().max())):
        of = int(cases.size().max())
        said.append(f"Crosses: in {count} of {of} cases the beam gave way or failed, and no error is stated.")
    return said


def _share(judged: pd.DataFrame, model: str) -> str:
    """Return which shares of the stable cases have small errors; what is not known to be stable does not count."""
    stable, doubted = (judged.loc[rows, "value"].dropna() for rows in (~judged["open"], judged["open"]))
    if not len(stable):
        return f"No stable case has an error of {model}."
    of, left = "cases", ""
    if len(doubted):
        of = f"{len(stable)} stable cases"
        left = f" {len(doubted)} cases that are not known to be stable do not count."
    return (
        f"Error of {model} against finite elements: {100 * (stable.abs() <= 10).mean():.0f} % of the {of} are "
        f"within 10 %, {100 * (stable.abs() <= 5).mean():.0f} % within 5 %; the errors lie between "
        f"{stable.min():+z.0f} and {stable.max():+z.0f} %.{left}"
    )


# What each axis does


def log_spaced(values: Array) -> bool:
    """Return whether rising values are rather log-spaced than evenly spaced.

    >>> log_spaced(np.array([0.1, 0.3, 1.0, 3.0])), log_spaced(np.array([1.0, 2.0, 3.0]))
    (True, False)
    """
    if len(values) < 3 or not values[0] > 0 or values[-1] / values[0] < LEAST_RATIO:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= SAME_RATIO * steps.mean())


def _grouped_axes(table: pd.DataFrame, axes: list[str]) -> tuple[pd.DataFrame, list[str], list[str]]:
    """Return the table and its axes with one axis for each group of axes that vary together, and sentences on them.

    The axis with the most values stands for its group; if its values repeat, the axis has the values of all as texts.
    """
    notes: list[str] = []
    if is_sampled(table, axes):
        return table, axes, notes
    for first, second in itertools.combinations(axes, 2):
        if first not in axes or second not in axes:
            continue
        leader, other = sorted((first, second), key=lambda name: -table[name].nunique())
        pairs = len(table[[leader, other]].drop_duplicates())
        if pairs == table[leader].nunique():
            notes.append(f"{in_words(other)} varies together with {in_words(leader)}.")
            axes = [name for name in axes if name != other]
        elif pairs < table[leader].nunique() * table[other].nunique():
            texts = [
                f"{value_of(first, a)}, {value_of(second, b)}"
                for a, b in zip(table[first], table[second], strict=True)
            ]
            both = f"{in_words(first)}, {in_words(second)}"
            axes = [both if name == first else name for name in axes if name != second]
            return _grouped_axes(table.assign(**{both: texts}), axes)
    return table, axes, notes


def _spread(tidy: pd.DataFrame, axes: Sequence[str], axis: str) -> tuple[float, bool]:
    """Return how far an axis spreads the values of each model, over their whole spread, and whether it changes any.

    A value of the axis for which all cases failed changes them, too.
    """
    solved = tidy.dropna(subset="value")
    values = solved.groupby(["model", *(name for name in axes if name != axis)], sort=False, dropna=False)["value"]
    least, most = values.min(), values.max()
    apart, whole = most - least, solved.groupby("model", sort=False)["value"].agg(np.ptp)
    differs = (apart > SAME * np.maximum(most.abs(), least.abs())).any()
    changes = differs or 0 < solved[axis].nunique() < tidy[axis].nunique()
    shares = apart.groupby("model", sort=False).mean()[whole > 0] / whole[whole > 0]
    return float(shares.sum()), bool(changes)


def view(tidy: pd.DataFrame, axes: Sequence[str]) -> View:
    """Choose what each axis does for some answers; axes without effect do nothing."""
    effects = {axis: _spread(tidy, axes, axis) for axis in axes}
    count = {axis: tidy[axis].nunique() for axis in axes}
    names = [axis for axis in axes if effects[axis][1]] or [axis for axis in axes if count[axis] > 1] or axes[:1]
    numbers = [axis for axis in names if tidy[axis].dtype.kind in "fiu"] or names
    long = [axis for axis in numbers if count[axis] > MOST_COLOURS]
    # the load's axes make curves that a reader knows; among equals the axis with the most values
    x = min(long or numbers, key=lambda axis: (not axis.startswith(("depth", "shear")), -count[axis]))
    second, *panels = sorted((axis for axis in names if axis != x), key=lambda axis: -count[axis]) or [""]
    maps = bool(second) and count[second] > MOST_COLOURS and tidy[x].dtype.kind in "fiu"
    # each model has maps of its own
    most, folded = MOST_PANELS // (tidy["model"].nunique() if maps else 1), list[str]()
    while panels and math.prod(count[axis] for axis in panels) > most:
        folded.append(min(panels, key=lambda axis: effects[axis][0]))
        panels.remove(folded[-1])
    return View(x, second, tuple(panels), tuple(folded), maps)


# Lines and maps


def _over_grid(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, part: Part) -> Iterator[Figure]:
    """Yield a quantity over the axes, and its errors."""
    tidy = answers(table, axes, study, part.column)
    some = tidy["value"].notna().any()
    if not len(tidy) or not (some or tidy["failed"].all()):
        return
    models = list(dict.fromkeys(tidy["model"]))
    diameters = table["D_mm"].dropna().unique() if "D_mm" in table else []
    D = float(diameters[0]) if len(diameters) == 1 else None
    notes = unanswered(tidy) if some else []
    tidy = _answering(tidy) if some else tidy
    look = view(tidy, axes)
    used = {look.x, look.second, *look.panels, *look.folded}
    if some and (idle := [in_words(axis) for axis in axes if table[axis].nunique() > 1 and axis not in used]):
        notes.append(f"{_list(idle)} {'changes' if len(idle) == 1 else 'change'} nothing in the {part.words}.")
    ends = [
        f"{name} from {values.min():.3g} to {values.max():.3g} {UNITS[part.unit]}".strip()
        for name, values in tidy[~tidy["open"]].dropna(subset="value").groupby("model", sort=False)["value"]
    ]
    which = "all stable cases" if tidy["open"].any() else "all cases"
    caption = f"Over {which}: {'; '.join(ends)}." if ends else "No case is stable." if some else "Every case failed."
    title = f"{_capital(part.words)} over {in_words(look.x)}{_alone(tidy)}"
    figure = _figure(tidy, look, part.title, part.words, models, D)
    yield replace(figure, title=title, caption=caption, notes=(*notes, *figure.notes))
    judged = _answering(errors(table, axes, study, part))
    if len(judged):
        caption = " ".join(_share(each, name) for name, each in judged.groupby("model", sort=False))
        figure = _figure(judged, view(judged, axes), ERROR, "error", models, D)
        yield replace(figure, title=f"Error of the {part.words}{_alone(judged)}", caption=caption)


def _answering(tidy: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of models with any value."""
    return tidy[tidy.groupby("model")["value"].transform("count") > 0]


def _alone(tidy: pd.DataFrame) -> str:
    """Return what the title adds where there is no legend of models: the name of the only one."""
    return f", {tidy['model'].iloc[0]}" if tidy["model"].nunique() == 1 else ""


def _figure(tidy: pd.DataFrame, look: View, label: str, words: str, models: Sequence[str], D: float | None) -> Figure:
    """Return lines or maps of some answers, whose axes without effect and folded axes take their extremes."""
    import altair as alt

    data, x = _merged(tidy, look, label), quantity_name(look.x)
    notes = []
    if look.folded:
        how = "the value of greatest magnitude" if look.maps else "lines at the greatest magnitude, shades over all"
        values = _list([in_words(axis) for axis in look.folded])
        notes = [f"{_capital(words)} over all values of {values}: {how}."]
    notes += marked(tidy, maps=look.maps)
    flags = [name for name in ("failed", "open") if data[name].any()]
    shown = data[[look.x, label, *flags]].rename(columns={look.x: x})
    titles = [[value_of(axis, value, D) for value in data[axis]] for axis in look.panels]
    if look.maps and data["model"].nunique() > 1:
        titles.insert(0, list(data["model"]))
    if titles:
        shown["panel"] = [", ".join(texts) for texts in zip(*titles, strict=True)]
    if look.maps:
        second, edges = quantity_name(look.second), ERROR_EDGES if label == ERROR else ()
        shown = shown.rename(columns={"open": "doubted"}).assign(**{second: data[look.second]})
        figure = heat("", "", shown, (x, second), label, edges=edges)
        return replace(figure, notes=(*figure.notes, *notes))
    if look.folded:
        shown = shown.assign(low=data["low"], high=data["high"])
    elif "limit" in data and look.x in ("depth_mm", "depth_over_D"):
        # a line far beyond the depths would squeeze them
        shown["limit"] = data["limit"].where(data["limit"].between(data[look.x].min(), data[look.x].max()))
        if shown["limit"].notna().any():
            notes.append("Dotted lines across: depth at which the press buckles sideways.")
    if look.second:
        shown["series"] = [value_of(look.second, value, D) for value in data[look.second]]
    if not look.second or len(models) > 1:
        shown["model" if look.second else "series"] = data["model"]
    numeric, span = data[look.x].dtype.kind in "fiu", None
    log = "x" if numeric and log_spaced(np.unique(data[look.x])) else ""
    if label == ERROR:
        span, said = _limits(data[label])
        notes = [*notes, SHADES, *said]
    elif log and data[label].min() > 0 and data[label].max() > WIDE * data[label].min():
        log += "y"
    shown = drawable(shown, x, label)
    layers = curves(shown, x, label, Axes(numeric, log, span), names=models if len(models) > 1 else ())
    chart = panels(alt.layer(*(bands() if label == ERROR else []), *layers), shown)
    return Figure("", "", chart, shown, tuple(notes))


def _merged(tidy: pd.DataFrame, look: View, label: str) -> pd.DataFrame:
    """Return a row for each mark: its axes, model, value of greatest magnitude with its range, and flags."""
    import pandas as pd

    keys = [axis for axis in (look.x, look.second, *look.panels) if axis]
    groups = tidy.groupby(["model", *keys], sort=False, dropna=False)
    low, high = groups["value"].min(), groups["value"].max()
    data = pd.DataFrame({label: high.where(high.abs() >= low.abs(), low), "low": low, "high": high})
    data["failed"], data["open"] = groups["failed"].any(), groups["open"].any()
    if "limit" in tidy:
        data["limit"] = groups["limit"].min()
    data = data.reset_index()
    # texts keep the order of the study
    rising = [axis for axis in keys if tidy[axis].dtype.kind in "fiu"]
    return data.sort_values(rising, kind="stable", ignore_index=True) if rising else data


def _limits(errors: pd.Series) -> tuple[tuple[float, float] | None, list[str]]:
    """Return the range of errors that is drawn, without few far beyond the others, and a sentence on these."""
    numbers = np.append(errors[np.isfinite(errors)].to_numpy(), [-10.0, 10.0])
    inside = numbers[abs(numbers) <= BEYOND * float(np.percentile(abs(numbers), 90))]
    beyond = numbers[(numbers < inside.min()) | (numbers > inside.max())]
    if not len(beyond):
        return None, []
    what = "1 error stands" if len(beyond) == 1 else f"{len(beyond)} errors stand"
    ends = " to ".join(dict.fromkeys(f"{value:.0f} %" for value in (beyond.min(), beyond.max())))
    room = 0.06 * (inside.max() - inside.min())
    return (float(inside.min() - room), float(inside.max() + room)), [f"{what} at the edge: {ends}."]


# Sampled points


def effect(x: Array, y: Array) -> float:
    """Return the share of the variance of y that the means over parts of x explain, 0 to 1."""
    some = np.isfinite(y)
    x, y = x[some], y[some]
    if len(y) < 2 or not y.std() > 0:
        return 0.0
    parts = np.array_split(y[np.argsort(x, kind="stable")], min(BINS, len(y)))
    between = sum(len(part) * (part.mean() - y.mean()) ** 2 for part in parts)
    return float(between / (len(y) * y.var()))


def _by_effect(tidy: pd.DataFrame, axes: Sequence[str]) -> list[str]:
    return sorted(axes, key=lambda axis: -effect(tidy[axis].to_numpy(float), tidy["value"].to_numpy(float)))


def _scattered(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, part: Part) -> Iterator[Figure]:
    """Yield the sampled answers and errors over each axis, and the errors over the two most effective ones."""
    import altair as alt
    import pandas as pd

    numeric = [axis for axis in axes if table[axis].dtype.kind in "fiu"]
    judged, x = errors(table, axes, study, part), "value of the axis"
    off, given = f"error of the {part.words}", answers(table, axes, study, part.column)
    for tidy, words, label in ((given, part.words, part.title), (judged, off, f"{off} (%)")):
        if not numeric or not tidy["value"].notna().any():
            continue
        # the models' values and errors hang on the axes alike: those of the widest spread tell most
        widest = tidy.groupby("model")["value"].std().fillna(0.0).idxmax()
        flags = [flag for flag in ("failed", "open") if tidy[flag].any()]
        parts = [
            tidy[flags].assign(
                **{x: tidy[axis], label: tidy["value"]}, panel=quantity_name(axis), series=tidy["model"]
            )
            for axis in _by_effect(tidy[tidy["model"] == widest], numeric)
        ]
        count = tidy["value"].notna().groupby(tidy["model"]).sum().max()
        caption = f"Each of the {count} points is one case; every panel shows the same cases over another axis."
        notes, shades = marked(tidy, maps=False), []
        if tidy is judged:
            caption += " " + " ".join(_share(each, model) for model, each in tidy.groupby("model", sort=False))
            notes, shades = [SHADES, *notes], bands()
        data = drawable(pd.concat(parts, ignore_index=True), x, label)
        drawn, note = thinned(data, label)
        chart = panels(alt.layer(*shades, *curves(drawn, x, label, Axes(line=False, titled=False))), drawn, own="x")
        title = f"{_capital(words)} of the sampled cases"
        yield Figure(title, caption, chart, data, (*note, *notes))
    for model, each in judged.dropna(subset="value").groupby("model", sort=False) if len(numeric) > 1 else ():
        pair = _by_effect(each, numeric)[:2]
        names = (quantity_name(pair[0]), quantity_name(pair[1]))
        cells = each[[*pair, "value"]].set_axis([*names, ERROR], axis=1)
        title = f"Error of the {part.words}, {model}, over the two most effective axes"
        yield spots(title, "", cells, names, ERROR, ERROR_EDGES)


# Pictures of a sweep: which rows and which quantities they show


MOST_DRAWN = 20_000
"""Largest number of cases that are drawn: more marks than a picture has room for."""
LARGE = 1000
"""Number of cases from which on the pictures leave out axes whose effect on the shown quantities is known."""


class Collected:
    """The rows of a sweep that its pictures show."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self._fixed, self._parts = plan, _fixed(plan), list[Columns]()
        self._counts = [factor.count for factor in plan.factors]
        self._drawn = [1 if k in self._fixed else count for k, count in enumerate(self._counts)]
        while math.prod(self._drawn) > MOST_DRAWN:
            longest = self._drawn.index(max(self._drawn))
            self._drawn[longest] = (self._drawn[longest] + 1) // 2

    def add(self, table: Columns, indices: NDArray[np.int64]) -> None:
        """Keep those rows of a table that are drawn."""
        rows = np.ones(len(indices), dtype=bool)
        for k, points in enumerate(np.unravel_index(indices, self._counts)):
            last, few = self._counts[k] - 1, self._drawn[k]
            rows &= np.isin(points, self._fixed.get(k, np.round(np.linspace(0, last, few))))
        if rows.any():
            self._parts.append({name: values[rows] for name, values in table.items()})

    def draw(self, path: Path) -> list[Path]:
        """Draw the pictures, one for each quantity, and return their files.

        The second one and further ones end in -2, -3 ... before the suffix; older files of such names are deleted.
        """
        import pandas as pd

        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        idle = {study_input.column(name) for k in self._fixed for name in self.plan.factors[k].names}
        table = pd.DataFrame(columns)
        study = SweepColumns.of_plan(self.plan)
        study = replace(study, axes=tuple(name for name in study.axes if name not in idle))
        names = (path if k == 1 else path.with_stem(f"{path.stem}-{k}") for k in itertools.count(1))
        files = []
        for quantity in self._quantities(study, table):
            drawn = sweep(table, study, [quantity])
            if drawn:
                files.append(next(names))
                figures.save(files[-1], drawn, notes=self._notes())
        for old in itertools.takewhile(Path.is_file, names):
            old.unlink()
        return files

    def _quantities(self, study: SweepColumns, table: pd.DataFrame) -> list[str]:
        sheared = self.plan.loads_sideways and ("shear" in self.plan.fields or bool(self.plan.load.get("shear")))
        present = drawn_quantities(study, table)
        present.sort(key=lambda name: (sheared and name != "force_x_N", not name.startswith("force")))
        more = any(name in self.plan.quantities for name in KINDS)
        return present if more else present[:1]

    def _notes(self) -> list[str]:
        notes = []
        for k, point in self._fixed.items():
            factor = self.plan.factors[k]
            if "E" in factor.names:
                E = factor.values[factor.names.index("E")][point]
                notes.append(f"Forces are proportional to E: drawn for E = {E:g} MPa.")
            others = [name for name in factor.names if name != "E"]
            if others:
                verb = "has" if len(others) == 1 else "have"
                notes.append(f"{', '.join(others)} {verb} no effect on what is shown.")
        return notes + [
            f"Of {factor.count} values of {factor.names[0]}, {few} are drawn; the table has all."
            for k, (factor, few) in enumerate(zip(self.plan.factors, self._drawn, strict=True))
            if few < factor.count and k not in self._fixed
        ]


def _fixed(plan: Plan) -> dict[int, int]:
    """Return the factors of a large study that the pictures show at one point only, with the number of this point.

    Forces do not depend on the Hall elements and the remanence, and are proportional to E.
    """
    matter = plan.matters("problems")
    idle = [k for k, factor in enumerate(plan.factors) if k not in matter and factor.count > 1]
    idle = [k for k in idle if "temperature" not in plan.factors[k].names]
    if "modes" in plan.quantities or "critical_depth" in plan.quantities:
        idle = [k for k in idle if "E" not in plan.factors[k].names]
    if plan.count < LARGE or len(idle) == len(plan.factors):
        return {}
    fixed = {}
    for k in idle:
        names, values = plan.factors[k].names, plan.factors[k].values
        E = [float(value) for value in values[names.index("E")]] if "E" in names else [plan.design.E]
        fixed[k] = min(range(len(E)), key=lambda point: abs(E[point] - plan.design.E))
    return fixed
