"""Tables and pages of the studies of validation: one writer for all of them, words in `templates`."""

import math
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from geometry.bad_input import BadInput, SolveFailed
from geometry.messages import Progress
from studies.output import page_templates
from studies.output.goals import Goal, failures, missed, verdict
from studies.output.result import Interrupted, Result, Table
from studies.simulation.compare import part

Case = TypeVar("Case")

Row = dict[str, Any]
"""A row of a table: values by the names of their columns, with units."""
TEMPLATES = Path(__file__).parent / "templates"
Misses = Mapping[str, float]
"""Values of what is missed by the names of goals or checks, NaN where nothing was measured."""


@dataclass(frozen=True, slots=True)
class Check:
    """A measured value beside the one that is expected.

    value : NaN where nothing could be measured, which is a miss.
    bound : largest difference from the expected value, relative unless that is 0.

    >>> Check("force", 1.02, 1.0, 0.05).passed, Check("gap", 0.02, 0.0, 0.01).passed, Check("", math.nan, 1, 1).passed
    (True, False, False)
    """

    name: str
    value: float
    expected: float
    bound: float

    @property
    def off(self) -> float:
        return abs(self.value / self.expected - 1) if self.expected else abs(self.value)

    @property
    def passed(self) -> bool:
        return bool(self.off <= self.bound)


EXPECTED: Mapping[str, Mapping[str, Misses]]
EXPECTED = tomllib.loads(Path(__file__).with_name("expected_misses.toml").read_text("utf-8"))
"""Misses that are known, by study and run, quick or full."""
CHANGE = 0.05
"""Largest relative change of the value of a known miss."""


def records(table: pd.DataFrame) -> list[Row]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def percentile(values: pd.Series, percent: float) -> float:
    """Return the least value that so many percent of the known ones do not exceed; NaN without any.

    >>> percentile(pd.Series([3.0, 1.0, 2.0, float("nan"), 4.0]), 75)
    3.0
    """
    known = values.dropna()
    return float(np.percentile(known, percent, method="inverted_cdf")) if len(known) else math.nan


def rendered(template: str, **values: Any) -> str:
    return page_templates.rendered(TEMPLATES / template, **values)


def against_expected(study: str, run: str, misses: Misses, said: Sequence[str]) -> Row:
    """Return what a run says of its misses, as fields of `Result`: remarks if just the expected ones are there.

    Any change is a failure: a new miss, another value, and an expected miss that is met.
    """
    expected = EXPECTED.get(study, {}).get(run, {})
    changes = [f"{name} is missed" for name in misses if name not in expected]
    changes += [f"{name} is met" for name in expected if name not in misses]
    for name, value in misses.items():
        known = expected.get(name, value)
        if not (math.isclose(value, known, rel_tol=CHANGE) or (math.isnan(value) and math.isnan(known))):
            changes.append(f"{name} is {value:.3g}")
    if misses and not changes:
        return {"remarks": [*said, "all misses are expected"]}
    if expected and changes:
        return {"failures": [*said, f"the expected misses changed: {'; '.join(changes)}"]}
    return {"failures": said}


def told(progress: Progress, chosen: Sequence[Case], name: Callable[[Case], str]) -> Iterator[Case]:
    for i, case in enumerate(chosen):
        progress(i / len(chosen), name(case))
        yield case


def report(progress: Progress, studies: Mapping[str, Callable[[Progress], Result]]) -> Result:
    """Return the results of studies by their names, as parts of one; a study that cannot run is one that says so."""
    if len(studies) == 1:
        return next(iter(studies.values()))(progress)
    done: list[Result] = []

    def together() -> Result:
        return Result(title="Validation", records=[], shown=[], parts=done)

    for k, (name, run) in enumerate(studies.items()):
        try:
            done.append(run(part(progress, k / len(studies), (k + 1) / len(studies), name) or progress))
        except (BadInput, SolveFailed) as error:
            done.append(Result(title=name, records=[], shown=[], failures=[f"{name}: {error}"]))
        except Interrupted as stop:
            done.append(stop.result)
            raise Interrupted(str(stop), together()) from None
        except KeyboardInterrupt:
            raise Interrupted(f"{len(done)} parts are complete, and no file is written", together()) from None
    return together()


def study(
    name: str,
    title: str,
    rows: Sequence[Row],
    page: Mapping[str, Any],
    printed: Sequence[Row] | None = None,
    look: Mapping[str, Any] = {},
    goals: Sequence[Goal] | None = None,
    misses: Mapping[str, float] | None = None,
    run: str = "full",
    **more: Any,
) -> Result:
    """Return the result of a study: rows in NAME.csv, and NAME.md from its template and the values of `page`.

    The terminal shows the table `printed` (default: the rows) with the fields `look`. Goals are values of the page
    (`verdict`, `goals` and those that are `missed`). Missed goals, or the `misses` of a study of checks of which each
    row is one, are failures, unless they are just those that are expected of the `run`, quick or full. `more` are
    fields of `Result`.
    """
    said: Sequence[str] = []
    if misses is not None and misses:
        said = [f"{len(misses)} of {len(rows)} are missed: {'; '.join(misses)}"]
    if goals is not None:
        lost = missed(goals)
        page = {"verdict": verdict(goals), "goals": goals, "missed": lost} | dict(page)
        misses = {goal.name: math.nan if goal.value is None else goal.value for goal in lost}
        said = failures(goals)
    if misses is not None:
        found = against_expected(name, run, misses, said)
        more = found | more | {"remarks": [*found.get("remarks", ()), *more.get("remarks", ())]}
    shown = [Table(title=title, rows=rows if printed is None else printed, **look)]
    text = {f"{name.upper()}.md": rendered(f"{name}.md.j2", **page)}
    return Result(title=title, pages=text, **({"records": rows, "shown": shown, "tables": {name: rows}} | more))
