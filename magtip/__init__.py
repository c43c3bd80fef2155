"""Soft magnetic three-axis force sensors by finite elements and formulas: the interface from Python.

Units are mm, N, MPa, T, V, rad, Hz and s; columns of tables carry theirs, as in `force_N`.

- `Design`, `paper`, `preset`: the sensor; `Load`: what is done to it; `solve`: its state by finite elements.
- `answer`: a table of sensors and loads in, a table of answers by any models out; `plot`: a chart of these answers;
  `tidy`: these answers in long form, a row for each model, quantity and part, with half widths and errors.
- `problem`: fields and bounds for the samplers of SALib, whose points `answer` takes.
- `size`: from `Requirements` to a variant of parts that are sold.
- `BadInput`, `SolveFailed`: what users can meet, each with one sentence; every other error is a bug.

>>> import magtip
>>> state = magtip.solve(magtip.paper(L=12.0), magtip.Load(depth=0.5), "quick")
>>> state.status, round(state.response.force[2], 1)
('ok', 1.1)

What takes longer to import, finite elements and tables, is imported where it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from geometry.bad_input import BadInput, SolveFailed
from geometry.design import Design, paper, preset
from geometry.loads import Load

if TYPE_CHECKING:
    from fem.equilibrium import solve
    from studies.answers import tidy
    from studies.cases import answer
    from studies.inputs.study_input import problem
    from studies.parts.requirements import Requirements
    from studies.sizing.sizing_study import size
    from studies.sweeps.answer_plot import plot
else:
    LATER = {
        "Requirements": "studies.parts.requirements",
        "answer": "studies.cases",
        "plot": "studies.sweeps.answer_plot",
        "problem": "studies.inputs.study_input",
        "size": "studies.sizing.sizing_study",
        "solve": "fem.equilibrium",
        "tidy": "studies.answers",
    }
    """Modules of the names that are imported at their first use; a type checker sees the imports above instead."""

    def __getattr__(name: str) -> object:
        if name not in LATER:
            raise AttributeError(f"module 'magtip' has no attribute {name!r}")
        globals()[name] = found = getattr(importlib.import_module(LATER[name]), name)
        return found

    def __dir__() -> list[str]:
        return sorted({*globals(), *LATER})


__all__ = [
    "BadInput",
    "Design",
    "Load",
    "Requirements",
    "SolveFailed",
    "answer",
    "paper",
    "plot",
    "preset",
    "problem",
    "size",
    "solve",
    "tidy",
]
