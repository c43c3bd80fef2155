"""A chart of answers from Python: `plot` draws the table of `studies.cases.answer` with the figures of a sweep.

The caller names the columns of axes and colours; which columns belong to a model the table's `attrs` say, or else the
names of the columns.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from geometry.bad_input import nearest
from geometry.design import BadInput
from studies.answers import Answers, SweepColumns, check_table
from studies.output import figures
from studies.output.figures import COLOURS, THEME
from studies.output.text_tables import name_and_unit, quantity_name
from studies.quantities import drawn_parts
from studies.sweeps import sweep_figures
from studies.sweeps.answer_curves import Axes, curves, drawable
from studies.sweeps.sweep_figures import in_words, log_spaced, value_of

if TYPE_CHECKING:
    import altair as alt
    import pandas as pd


def plot(answers: pd.DataFrame, x: str, y: str | Sequence[str], color: str = "") -> alt.LayerChart:
    """Return a chart of answers, with units at its axes and bars for the errors that the table states.

    A line joins the points of each model if each has one value for each x, and these are no samples. Open markers are
    states that are unstable or not known to be stable, crosses are cases without an answer; a sentence below the
    chart says so.

    Parameters
    ----------
    answers : table that `answer` returned, or some of its rows and columns, `status` among them.
    x : column of the horizontal axis, such as `L_mm`.
    y : what stands above it: a quantity with its unit, such as `force_N`, of all models side by side; or the column
        of one model, such as `fem_force_N`, or one of your own; or several of them.
    color : column whose values, at most seven, have colours of their own; default: the models have them.

    Returns
    -------
    A chart of Altair with the look of magtip's own figures: `chart.save("force.svg")`, or .png, .html, .json.

    Raises
    ------
    BadInput
        A column is missing, has too many values for colours, or no row has an answer.

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.cases import answer
    >>> found = answer(pd.DataFrame({"L_mm": [8, 10, 12], "depth_mm": 1.0}), ["surrogate", "finite"])
    >>> chart = plot(found, x="L_mm", y="force_N")
    >>> [layer["mark"]["type"] for layer in chart.to_dict()["layer"]]
    ['rule', 'line', 'point']
    """
    import altair as alt
    import pandas as pd

    names = list(y) if isinstance(y, Sequence) and not isinstance(y, str) else [y]
    check_table(answers)
    _check(answers, x, color, names)
    stated = Answers.of_table(answers)
    study = stated.columns
    label = _label(names, study)
    axes = list(dict.fromkeys(filter(None, (x, color))))
    tidy = pd.concat([_answers(answers, axes, stated, name) for name in names], ignore_index=True)
    if not tidy["value"].notna().any():
        raise BadInput(f"no row has an answer for {' and '.join(names)}: see the columns status and message")
    keys = [*axes, "model"]
    numeric = tidy[x].dtype.kind in "fiu"
    varying = [axis for axis in study.axes if answers[axis].nunique() > 1]
    joined = numeric and not tidy.duplicated(keys).any() and not sweep_figures.is_sampled(answers, varying)
    tidy = tidy.sort_values(x, kind="stable") if joined else tidy
    shown = pd.DataFrame({quantity_name(x): tidy[x], label: tidy["value"]})
    shown = shown.assign(**{flag: tidy[flag] for flag in ("failed", "open") if tidy[flag].any()})
    if tidy["half_width"].notna().any():
        shown = shown.assign(low=tidy["value"] - tidy["half_width"], high=tidy["value"] + tidy["half_width"])
    if color:
        shown["series"] = [value_of(color, value) for value in tidy[color]]
    if tidy["model"].nunique() > 1 or not color:
        shown["model" if color else "series"] = tidy["model"]
    log = "x" if numeric and log_spaced(np.unique(tidy[x].dropna())) else ""
    shown = drawable(shown, quantity_name(x), label)
    drawn, note = (shown, ()) if joined else figures.thinned(shown, label)
    # Altair refuses to show more than 5000 rows
    drawn = drawn[drawn["drawn"] | drawn.get("failed", False)].drop(columns="drawn") if note else shown
    how = Axes(line=joined, log=log, bars=True)
    chart = alt.layer(*curves(drawn, quantity_name(x), label, how), data=drawn)
    said = _bars(set(tidy.loc[tidy["half_width"].notna(), "model"]), study)
    said += [*sweep_figures.marked(tidy, maps=False), *sweep_figures.unanswered(tidy)]
    said += [*sweep_figures.failures(answers), *note]
    chart = chart.properties(width=figures.WIDTH, height=figures.HEIGHTS[0])
    configured: alt.LayerChart = (chart.properties(title=figures.foot(said)) if said else chart).configure(**THEME)
    return configured


def _bars(titles: Collection[str], study: SweepColumns) -> list[str]:
    """Return what the bars of models are; what those of a column of the user's own are, the user knows."""
    kinds = [study.kind(model) for model in study.models if study.title(model) in titles]
    words = list(dict.fromkeys(text for kind in kinds for text in kind.half_widths))
    return [f"Bars, where longer than the marker: {', '.join(words)}."] if words else []


def _check(answers: pd.DataFrame, x: object, color: object, names: Sequence[object]) -> None:
    for what, name in (("x", x), *((("color", color),) if color != "" else ())):
        if not isinstance(name, str) or name not in answers:
            raise BadInput(f"{what} must be a column of the answers; got {name!r}: {nearest(str(name), answers)}")
    if not names or not all(isinstance(name, str) for name in names):
        raise BadInput(f"y must be the name of a column, or a list of names; got {names!r:.60}")
    if color != "" and (count := answers[color].nunique()) > len(COLOURS):
        raise BadInput(f"{color} has {count} values, and {len(COLOURS)} colours can be told apart: take fewer rows")


def _label(names: Sequence[str], study: SweepColumns) -> str:
    """Return the label of the vertical axis; BadInput if quantities do not share their unit."""
    units = [name_and_unit(name)[1] for name in names]
    if len(set(units)) > 1:
        other = next(k for k, unit in enumerate(units) if unit != units[0])
        raise BadInput(f"{names[0]} and {names[other]} have other units: draw them in two charts")
    quantity = _model_of(names[0], study)[1]
    part = drawn_parts().get(quantity)
    return part.title if part else quantity_name(quantity)


def _model_of(name: str, study: SweepColumns) -> tuple[str, str]:
    """Return the model of a column, "" for none, and the column without the model's name."""
    fitting = [(len(prefix), model) for model, prefix in study.models.items() if name.startswith(prefix)]
    # the longest beginning: fem_half_quick_ also begins with fem_
    length, model = max(fitting, default=(0, ""))
    return model, name[length:]


def _answers(answers: pd.DataFrame, axes: Sequence[str], stated: Answers, name: str) -> pd.DataFrame:
    """Return the rows of `sweep_figures.answers` of a quantity, or of one column, with their half widths."""
    study = stated.columns
    model, quantity = _model_of(name, study)
    if name in answers and model:
        study, name = replace(study, models={model: study.models[model]}), quantity
    elif name in answers and name not in drawn_parts():
        part = answers[list(axes)].assign(model=in_words(name), value=answers[name], failed=False, open=False)
        return part.assign(half_width=answers.get(f"{name}_half_width", np.nan))
    models = study.answers(name, answers.columns)
    if not models:
        raise BadInput(f"the answers have no {name!r}: {nearest(name, _quantities(answers, study))}")
    tidy = sweep_figures.answers(answers, axes, study, name)
    return tidy.assign(half_width=np.concatenate([stated.half_width_of(model, name) for model in models]))


def _quantities(answers: pd.DataFrame, study: SweepColumns) -> list[str]:
    """Return what can be drawn: columns without their model's name, and the columns themselves."""
    columns = [str(name) for name in answers if answers[name].dtype.kind in "fiu"]
    return list(dict.fromkeys([*(_model_of(name, study)[1] for name in columns), *columns]))
