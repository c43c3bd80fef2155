"""Figures of a sweep's table: quantities over its axes by all models, with their errors, for picture and page.

What a column is, an axis or an answer of a model, the study says (`studies.answers.SweepColumns`). The
longest axis of numbers is horizontal, the next one has colours, or is the vertical axis of maps if it has many
values; up to two more make panels. Axes without effect are named, and what would need too many panels is shown by its
extremes. Each model has markers and dashes, or panels of maps, of its own. Sampled points are shown over each axis.
Of a study with more than some ten thousand cases every k-th value of its longest axes is drawn, and a note says so.
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
from studies.output.figures import SHADES, Figure, bands, panels, short, thinned
from studies.output.maps import ERROR_EDGES, WIDE, heat, spots
from studies.output.text_tables import quantity_name
from studies.quantities import drawn_parts
from studies.sweeps.answer_curves import Axes, curves, drawable

if TYPE_CHECKING:
    import pandas as pd

MOST_COLOURS = 6
"""Greatest number of values of an axis that are told apart by colours."""
MOST_PANELS = 12
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


class Subject(NamedTuple):
    """What a figure shows: its title, the label of its numbers, and whether these are errors of models, in %."""

    title: str
    label: str
    is_error: bool = False


def sweep(table: pd.DataFrame, study: SweepColumns, quantities: Sequence[str] = ()) -> list[Figure]:
    """Return the figures of rows of sweep.csv, those of a quantity and of its errors one after the other."""
    axes = [name for name in study.axes if table[name].nunique() > 1] or list(study.axes[:1])
    if not axes or not len(table):
        return []
    table, axes, notes = _grouped_axes(table, axes)
    notes += failures(table)
    draw = _scattered if is_sampled(table, axes) else _over_grid
    drawn = [figure for quantity in quantities or drawn_parts() for figure in draw(table, axes, study, quantity)]
    return [replace(drawn[0], notes=(*drawn[0].notes, *notes)), *drawn[1:]] if drawn else []


def drawn_quantities(study: SweepColumns, table: pd.DataFrame) -> list[str]:
    """Return the quantities that figures show of a table."""
    return [name for name in drawn_parts() if study.answers(name, table.columns)]


def is_sampled(table: pd.DataFrame, axes: Sequence[str]) -> bool:
    """Return whether the points fill the space of the axes without a grid."""
    return len(table) > 8 and all(table[name].nunique() > 0.5 * len(table) for name in axes) and len(axes) > 1


def answers(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, quantity: str) -> pd.DataFrame:
    """Return the answers of all models to a quantity, a row for each model and case, model after model.

    Columns are the axes, the model's name, the `value` (NaN where the model failed), whether it `failed`, whether
    the state is not known to be stable (`open`), and the depth at which the press buckles (`limit`), where known.
    """
    import pandas as pd

    parts = []
    for model, column in study.answers(quantity, table.columns).items():
        failed, doubted = _verdicts(table, study, model)
        value = table[column].where(~failed)
        # a formula knows no stability
        opened = doubted & value.notna() & study.kind(model).states_errors
        parts.append(_part(table, axes, study.title(model), value, failed).assign(open=opened))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({"model": [], "value": []})


def errors(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, quantity: str) -> pd.DataFrame:
    """Return the errors of all models against the reference as `answers` does; the reference says what is stable."""
    import pandas as pd

    column = drawn_parts()[quantity].error_column
    failed, doubted = _verdicts(table, study, study.reference)
    gave_way = table["error_status"] == "gave_way" if "error_status" in table else pd.Series(False, table.index)
    parts = []
    for model, name in study.errors(column, table.columns).items():
        lost = failed | gave_way | _verdicts(table, study, model)[0]
        value = table[name].where(~lost)
        parts.append(
            _part(table, axes, study.title(model), value, lost).assign(
                open=doubted & value.notna(), gave_way=gave_way
            )
        )
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame({"model": [], "value": []})


def _part(table: pd.DataFrame, axes: Sequence[str], model: str, value: pd.Series, failed: pd.Series) -> pd.DataFrame:
    part = table[list(axes)].assign(model=model, value=value, failed=failed)
    if "critical_depth_mm" in table:
        part["limit"] = table["critical_depth_mm"] / (table["D_mm"] if "depth_over_D" in axes else 1.0)
    return part


def _verdicts(table: pd.DataFrame, study: SweepColumns, model: str) -> tuple[pd.Series, pd.Series]:
    """Return where a model has no answer, and where its state is not known to be stable; of "" that of the row."""
    own = study.status(model)
    status = table[own if own in table else "status"]
    answered = status.isin(ANSWERED)
    # the search for a critical depth may doubt a state of the reference
    later = table["status"].isin(ANSWERED) & (table["status"] != "ok") & (model in ("", study.reference))
    return ~answered, answered & ((status != "ok") | later)


def value_of(column: str, value: Any, D: float | None = None) -> str:
    """Return a value of an axis with its name, of L and depth also over a diameter D, mm.

    >>> value_of("L_mm", 9.0), value_of("L_mm", 9.0, 6.0), value_of("L_over_D", 1.5, 6.0)
    ('L = 9 mm', 'L = 9 mm (L/D = 1.5)', 'L/D = 1.5')
    """
    if isinstance(value, str) and " = " in value:  # axes that vary together have their names in their values
        return value
    name, _, unit = quantity_name(column).partition(" (")
    over = f" ({name}/D = {value / D:.3g})" if D is not None and column in ("L_mm", "depth_mm", "shear_mm") else ""
    return f"{name} = {short(value)} {unit.rstrip(')')}".strip() + over


def _diameter(table: pd.DataFrame) -> float | None:
    """Return the diameter of all beams of a table, mm; None if it varies or is unknown."""
    known = table["D_mm"].dropna().unique() if "D_mm" in table else []
    return float(known[0]) if len(known) == 1 else None


def log_spaced(values: Array) -> bool:
    """Return whether rising values are rather log-spaced than evenly spaced.

    >>> log_spaced(np.array([0.1, 0.3, 1.0, 3.0])), log_spaced(np.array([1.0, 2.0, 3.0]))
    (True, False)
    """
    if len(values) < 3 or not values[0] > 0 or values[-1] / values[0] < LEAST_RATIO:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= SAME_RATIO * steps.mean())


def failures(table: pd.DataFrame) -> list[str]:
    """State in a sentence how many cases failed and why."""
    lost = table[~table["status"].isin(ANSWERED)]
    if not len(lost):
        return []
    kinds = Counter(lost["status"])
    causes = ", ".join(f"{count} {status}" if len(kinds) > 1 else status for status, count in kinds.most_common(3))
    text = f"{len(lost)} of {len(table)} cases failed ({causes})"
    reasons = Counter(message for message in lost.get("message", ()) if isinstance(message, str) and message)
    for reason, _ in reasons.most_common(1):
        first, *others = reason.split("; ")
        for clause in others:
            if len(first) + len(clause) > MOST_NOTED:
                break
            first += f"; {clause}"
        # a long clause ends with a colon and the remedy
        text += f"; most often: {first if len(first) <= MOST_NOTED else first.rpartition(': ')[0] or first}"
    return [text.rstrip(".") + "."]


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


def in_words(column: str) -> str:
    """Return the name of an axis without its unit."""
    return quantity_name(column).partition(" (")[0]


def _spread(tidy: pd.DataFrame, axes: Sequence[str], axis: str) -> tuple[float, bool]:
    """Return how far an axis spreads the values of each model, over their whole spread, and whether it changes any.

    A value of the axis for which all cases failed changes them, too.
    """
    others = [name for name in axes if name != axis]
    solved = tidy[tidy["value"].notna()]
    size, changes = 0.0, 0 < solved[axis].nunique() < tidy[axis].nunique()
    for _, each in solved.groupby("model", sort=False):
        values = each["value"] if not others else each.groupby(others, sort=False, dropna=False)["value"]
        most, least = np.atleast_1d(values.max()), np.atleast_1d(values.min())
        apart, magnitude = most - least, np.maximum(abs(most), abs(least))
        changes |= bool((apart > SAME * magnitude).any())
        whole = float(each["value"].max() - each["value"].min())
        size += float(np.nanmean(apart)) / whole if whole > 0 else 0.0
    return size, changes


def view(tidy: pd.DataFrame, axes: Sequence[str]) -> View:
    """Choose what each axis does for some answers; axes without effect do nothing."""
    effects = {axis: _spread(tidy, axes, axis) for axis in axes}
    count = {axis: tidy[axis].nunique() for axis in axes}
    names = (
        [axis for axis in axes if effects[axis][1]] or [axis for axis in axes if count[axis] > 1] or list(axes[:1])
    )
    numbers = [axis for axis in names if tidy[axis].dtype.kind in "fiu"] or names
    long = [axis for axis in numbers if count[axis] > MOST_COLOURS]
    # the load's axes make curves that a reader knows; among equals the axis with the most values
    x = min(long or numbers, key=lambda axis: (axis.partition("_")[0] not in ("depth", "shear"), -count[axis]))
    second, *rest = [*sorted((axis for axis in names if axis != x), key=lambda axis: -count[axis]), ""]
    maps = bool(second) and count[second] > MOST_COLOURS and tidy[x].dtype.kind in "fiu"
    panels, folded = [axis for axis in rest if axis], list[str]()
    # each model has maps of its own
    while (
        panels and math.prod(count[axis] for axis in panels) * (tidy["model"].nunique() if maps else 1) > MOST_PANELS
    ):
        folded.append(min(panels, key=lambda axis: effects[axis][0]))
        panels.remove(folded[-1])
    return View(x, second, tuple(panels), tuple(folded), maps)


def _over_grid(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, quantity: str) -> Iterator[Figure]:
    tidy = answers(table, axes, study, quantity)
    some = tidy["value"].notna().any()
    if not len(tidy) or not (some or tidy["failed"].all()):
        return
    label = drawn_parts()[quantity].title
    words, unit, models = in_words(label), label.partition("(")[2].rstrip(")"), tuple(dict.fromkeys(tidy["model"]))
    known = tidy.groupby("model", sort=False)["value"].count()
    silent = list(known.index[known == 0]) if some else []
    notes = unanswered(tidy) if some else []
    tidy = tidy[~tidy["model"].isin(silent)]
    look = view(tidy, axes)
    used = {look.x, look.second, *look.panels, *look.folded}
    if some and (idle := [in_words(axis) for axis in axes if table[axis].nunique() > 1 and axis not in used]):
        notes.append(f"{_list(idle)} {'changes' if len(idle) == 1 else 'change'} nothing in the {words}.")
    ends = [
        f"{name} from {values.min():.3g} to {values.max():.3g} {unit}".strip()
        for name, values in tidy[~tidy["open"]].dropna(subset="value").groupby("model", sort=False)["value"]
    ]
    which = "all stable cases" if tidy["open"].any() else "all cases"
    caption = f"Over {which}: {'; '.join(ends)}." if ends else "No case is stable." if some else "Every case failed."
    subject = Subject(f"{_capital(words)} over {in_words(look.x)}{_alone(tidy)}", label)
    yield _drawn(subject, caption, tidy, look, table, notes, models)
    judged = errors(table, axes, study, quantity)
    judged = judged[judged.groupby("model")["value"].transform("count") > 0]
    if len(judged):
        caption = " ".join(_share(part, name) for name, part in judged.groupby("model", sort=False))
        name = drawn_parts()[quantity].words
        subject = Subject(f"Error of the {name}{_alone(judged)}", "error (%)", is_error=True)
        yield _drawn(subject, caption, judged, view(judged, axes), table, [], models)


def _alone(tidy: pd.DataFrame) -> str:
    """Return what the title adds where there is no legend of models: the name of the only one."""
    return f", {tidy['model'].iloc[0]}" if tidy["model"].nunique() == 1 else ""


def unanswered(tidy: pd.DataFrame) -> list[str]:
    """State in how many cases a model has no answer that another one has."""
    lost = tidy.groupby("model", sort=False)["failed"].sum()
    if lost.min() == lost.max():
        return []
    of = len(tidy) // len(lost)
    named = [f"{name} in {count if count < of else 'all'}" for name, count in lost.items() if count > lost.min()]
    marked = " (crosses)" if ((lost > lost.min()) & (lost < of)).any() else ""
    return [f"Without an answer{marked}: {'; '.join(named)} of {of} cases."]


def _drawn(
    subject: Subject,
    caption: str,
    tidy: pd.DataFrame,
    look: View,
    table: pd.DataFrame,
    notes: list[str],
    names: tuple[str, ...],
) -> Figure:
    """Return lines or maps of some answers, whose axes without effect and folded axes take their extremes."""
    import altair as alt

    label, diameter = subject.label, _diameter(table)
    data = _merged(tidy, look, label)
    if look.folded:
        how = "the value of greatest magnitude" if look.maps else "lines at the greatest magnitude, shades over all"
        values = _list([in_words(axis) for axis in look.folded])
        notes = [*notes, f"{_capital(in_words(label))} over all values of {values}: {how}."]
    notes = [*notes, *marked(tidy, maps=look.maps)]
    flags = {name: data[name] for name in ("failed", "open") if data[name].any()}
    shown = data[[]].assign(**{quantity_name(look.x): data[look.x], label: data[label], **flags})
    several = data["model"].nunique() > 1
    titles = [data[axis].map(lambda value, axis=axis: value_of(axis, value, diameter)) for axis in look.panels]
    if look.maps and several:
        titles.insert(0, data["model"])
    if titles:
        shown["panel"] = [", ".join(texts) for texts in zip(*titles, strict=True)]
    if look.maps:
        shown = shown.rename(columns={"open": "doubted"})
        shown[quantity_name(look.second)] = data[look.second]
        across = (quantity_name(look.x), quantity_name(look.second))
        edges = ERROR_EDGES if subject.is_error else ()
        figure = heat(subject.title, caption, shown, across, label, edges=edges)
        return replace(figure, notes=(*figure.notes, *notes))
    if look.folded:
        shown = shown.assign(low=data["low"], high=data["high"])
    elif "limit" in data and look.x in ("depth_mm", "depth_over_D"):
        # a line far beyond the depths would squeeze them
        inside = data["limit"].between(data[look.x].min(), data[look.x].max())
        shown["limit"] = data["limit"].where(inside)
        notes += ["Dotted lines across: depth at which the press buckles sideways."] if inside.any() else []
    if look.second:
        shown["series"] = [value_of(look.second, value, diameter) for value in data[look.second]]
    if not look.second or len(names) > 1:
        shown["model" if look.second else "series"] = data["model"]
    x, numeric = quantity_name(look.x), data[look.x].dtype.kind in "fiu"
    log, span = "x" if numeric and log_spaced(np.unique(data[look.x])) else "", None
    if subject.is_error:
        span, said = _limits(data[label])
        notes = [*notes, SHADES, *said]
    elif log and data[label].min() > 0 and data[label].max() > WIDE * data[label].min():
        log += "y"
    shown = drawable(shown, x, label)
    layers = curves(shown, x, label, Axes(numeric, log, span), names=names if len(names) > 1 else ())
    chart = panels(alt.layer(*(bands() if subject.is_error else []), *layers), shown)
    return Figure(subject.title, caption, chart, shown, tuple(notes))


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


def marked(tidy: pd.DataFrame, *, maps: bool) -> list[str]:
    """Return what the marks of a figure mean, with the numbers of cases, which each model has once."""
    said = []
    cases = tidy.groupby("model", sort=False)
    if count := int(cases["open"].sum().max()):
        what = "1 case is" if count == 1 else f"{count} cases are"
        mark = "dots" if maps else "open markers"
        said.append(
            f"{_capital(mark)}: {what} unstable, or not known to be stable; a real sensor may leave such a state."
        )
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


def effect(x: Array, y: Array) -> float:
    """Return the share of the variance of y that the means over parts of x explain, 0 to 1."""
    some = np.isfinite(y)
    x, y = x[some], y[some]
    if len(y) < 2 or not y.std() > 0:
        return 0.0
    parts = np.array_split(y[np.argsort(x, kind="stable")], min(BINS, len(y)))
    between = sum(len(part) * (part.mean() - y.mean()) ** 2 for part in parts)
    return float(between / (len(y) * y.var()))


def _scattered(table: pd.DataFrame, axes: Sequence[str], study: SweepColumns, quantity: str) -> Iterator[Figure]:
    """Yield the sampled answers and errors over each axis, and the errors over the two most effective ones."""
    import altair as alt
    import pandas as pd

    numeric = [axis for axis in axes if table[axis].dtype.kind in "fiu"]
    label, name = drawn_parts()[quantity].title, drawn_parts()[quantity].words
    judged = errors(table, axes, study, quantity)
    for tidy, unit in ((answers(table, axes, study, quantity), label), (judged, f"error of the {name} (%)")):
        if not numeric or not tidy["value"].notna().any():
            continue
        # the models' values and errors hang on the axes alike: those of the widest spread tell most
        widest = tidy.groupby("model")["value"].std().fillna(0.0).idxmax()
        order = _by_effect(tidy[tidy["model"] == widest], numeric)
        flags = [flag for flag in ("failed", "open") if tidy[flag].any()]
        parts = [
            tidy[flags].assign(
                **{"value of the axis": tidy[axis], unit: tidy["value"]},
                panel=quantity_name(axis),
                series=tidy["model"],
            )
            for axis in order
        ]
        is_error = unit != label
        count = tidy["value"].notna().groupby(tidy["model"]).sum().max()
        caption = f"Each of the {count} points is one case; every panel shows the same cases over another axis."
        notes = marked(tidy, maps=False)
        if is_error:
            caption += " " + " ".join(_share(part, model) for model, part in tidy.groupby("model", sort=False))
        title, x = f"{_capital(in_words(unit))} of the sampled cases", "value of the axis"
        data = drawable(pd.concat(parts, ignore_index=True), x, unit)
        drawn, note = thinned(data, unit)
        layers = [*(bands() if is_error else []), *curves(drawn, x, unit, Axes(line=False))]
        chart = panels(alt.layer(*layers), drawn, shared=False)
        yield Figure(title, caption, chart, data, (*note, *([SHADES] if is_error else []), *notes))
    for model, part in judged.groupby("model", sort=False) if len(numeric) > 1 else ():
        solved = part[part["value"].notna()]
        pair = _by_effect(solved, numeric)[:2]
        cells = pd.DataFrame({quantity_name(axis): solved[axis] for axis in pair} | {"error (%)": solved["value"]})
        title = f"Error of the {name}, {model}, over the two most effective axes"
        names = (quantity_name(pair[0]), quantity_name(pair[1]))
        yield spots(title, "", cells, names, "error (%)", ERROR_EDGES)


def _by_effect(tidy: pd.DataFrame, axes: Sequence[str]) -> list[str]:
    return sorted(axes, key=lambda axis: -effect(tidy[axis].to_numpy(float), tidy["value"].to_numpy(float)))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _list(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


# Pictures of a sweep: which rows and which quantities they show


MOST_DRAWN = 20_000
"""Largest number of cases that are drawn: more marks than a picture has room for."""
LARGE = 1000
"""Number of cases from which on the pictures leave out axes whose effect on the shown quantities is known."""


class Collected:
    """The rows of a sweep that its pictures show."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._fixed = _fixed(plan)
        counts = [factor.count for factor in plan.factors]
        self._drawn = [1 if k in self._fixed else count for k, count in enumerate(counts)]
        while math.prod(self._drawn) > MOST_DRAWN:
            longest = self._drawn.index(max(self._drawn))
            self._drawn[longest] = (self._drawn[longest] + 1) // 2
        self._chosen = [
            np.isin(np.arange(count), self._fixed.get(k, np.round(np.linspace(0, count - 1, few))))
            for k, (count, few) in enumerate(zip(counts, self._drawn, strict=True))
        ]
        self._parts: list[Columns] = []

    def add(self, table: Columns, indices: NDArray[np.int64]) -> None:
        """Keep those rows of a table that are drawn."""
        rows = np.ones(len(indices), dtype=bool)
        stride = self.plan.count
        for factor, chosen in zip(self.plan.factors, self._chosen, strict=True):
            stride //= factor.count
            rows &= chosen[indices // stride % factor.count]
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
