"""Designs and loads on which the error estimates of `fem` are calibrated and tested.

The twelve designs are the paper's and eleven of a Sobol sequence over D, L/D, nu and the magnet's three lengths, with
silicone walls of 0.06 D or more. Each is solved with its magnet rigid and with it ignored. The form of the estimates'
rules was chosen on the even-numbered designs; their constants were then widened to hold on all. Shares are therefore
also given for the odd designs alone.
"""

import csv
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fem.accuracy import Accuracy
from fem.analyses.stability import DEEPEST
from fem.results.error_estimates import FAR_SHEAR, FRICTION_SHEAR, STICK_SHEAR
from fem.scene import PRESS_DEPTH, Model, press_limits
from geometry.design import Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies import cases
from studies.cases import FemModel
from studies.simulation.compare import part

DESIGNS = 12
DEPTHS = (0.03, 0.1, PRESS_DEPTH)
"""Depths of a press over D; all are scaled down in proportion if the silicone is too thin for the deepest."""
STICK = (0.1, (0.0, 0.05, STICK_SHEAR))
"""Largest depth, and shears of the glued plate, over D."""
RUB = ((0.0, 0.04, FRICTION_SHEAR), 0.4)
"""Shears with Coulomb friction over D, at the depth of STICK, for partial and full slip; coefficient of friction."""
DEEP = (0.25, 0.5, 1.0)
"""Depths of deep presses: 0 is the deepest depth of scene press, 1 the deepest of the study."""
FAR = (0.3, FAR_SHEAR)
"""Large shears of the glued plate over D."""
GRIP = (0.2, STICK_SHEAR)
"""Height and shear of a grip over D."""
TANGENT_SCENES = ("critical", "small shear", "modes")
"""Scenes that follow from a tangent about a press: critical depths, small shears of a glued plate, frequencies."""
SHALLOW = 0.1 / PRESS_DEPTH
"""Smaller depth of a small shear, over the larger one."""


class Trial(NamedTuple):
    """One path of loads on one design.

    `number` is that of the design, 0 the paper's; `scene` is press, deep, stick, far, friction or grip, or one of
    TANGENT_SCENES, whose loads are depths: for scene critical the deepest one of the search.
    """

    number: int
    design: Design
    magnet: Magnet
    scene: str
    model: Model
    loads: tuple[Load, ...]

    @property
    def odd(self) -> bool:
        return self.number % 2 == 1

    @property
    def name(self) -> str:
        return f"design {self.number}, magnet {self.magnet}, {self.model} {self.scene}"


def trial(number: int, magnet: Magnet, scene: str, model: Model) -> Trial:
    design = designs()[number]
    D = design.D
    first, most = press_limits(design, magnet)
    depth, room = rounded(min(STICK[0] * D, first)), design.L - design.magnet_height * (magnet == "rigid")
    depths = {"press": [d / DEPTHS[-1] * first for d in DEPTHS], "deep": [first + d * (most - first) for d in DEEP]}
    depths |= {"critical": [DEEPEST * room], "small shear": [SHALLOW * first, first], "modes": [0.0, first]}
    shears = {"stick": STICK[1], "far": FAR, "friction": RUB[0]}
    if scene in depths:
        loads = [Load(depth=rounded(each)) for each in depths[scene]]
    elif scene in shears:
        mu: Any = RUB[1] if scene == "friction" else "stick"
        loads = [Load(depth=depth, shear_x=rounded(x * D), friction=mu) for x in shears[scene]]
    else:
        loads = [Load(grip=rounded(GRIP[0] * D), shear_x=rounded(GRIP[1] * D))]
    return Trial(number, design, magnet, scene, model, tuple(loads))


@functools.cache
def designs(table: str = "error") -> tuple[Design, ...]:
    """Return the designs of a table, whose columns are fields of the design; an empty cell has the usual value."""
    with Path(__file__).with_name(f"{table}_designs.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    fields: list[dict[str, Any]] = [
        {name: text if name == "law" else float(text) for name, text in row.items() if text} for row in rows
    ]
    return tuple(Design(**each) for each in fields)


def rounded(value: float) -> float:
    return float(f"{value:.4g}")


MESHES = {
    "press": ((0.025, 0.001, 0), (0.018, 0.001, 0), (0.013, 0.001, 0)),
    "tangent": ((0.045, 0.002, 1), (0.028, 0.001, 1), (0.02, 0.0007, 1)),
    "friction": ((0.09, 0.001, 3, 1.0), (0.06, 0.001, 4, 0.5), (0.045, 0.001, 5, 0.35)),
    "shear": ((0.09, 0.003, 3), (0.06, 0.0015, 5), (0.045, 0.00075, 6)),
}
"""Size and patch over D, harmonics and friction step factor of references: rough, usual and finer."""


def reference(scene: str, fineness: int = 1) -> Accuracy:
    """Return the accuracy of the reference: fineness 1; 0 is coarser, for a quick run; 2 is finer, to check 1."""
    kinds = {"press": "press", "deep": "press", "friction": "friction"} | dict.fromkeys(TANGENT_SCENES, "tangent")
    size, patch, *more = MESHES[kinds.get(scene, "shear")][fineness]
    return Accuracy(("rough", "reference", "finer")[fineness], size, 0.05, patch, 0.02, *more)  # type: ignore[arg-type]


def answers_of(
    states: Sequence[tuple[Design, Load, Magnet]],
    models: Sequence[str | FemModel],
    quantities: Sequence[str],
    progress: Progress | None = None,
    **options: Any,
) -> pd.DataFrame:
    """Return the answer to each state by its own model, in columns whose names leave that of the model out.

    `options` are those of `cases.answer`.
    """
    asked = cases.table(states)
    # without shear_mm the engine leaves out what is zero by symmetry
    asked["shear_mm"] = [load.shear_x for _, load, _ in states]
    parts, different = [], list(dict.fromkeys(models))
    for k, model in enumerate(different):
        rows = np.flatnonzero([model == own for own in models])
        name = model if isinstance(model, str) else model.name
        told = part(progress, k / len(different), (k + 1) / len(different), name)
        parts.append(cases.answer(asked.iloc[rows], [model], quantities=quantities, progress=told, **options))
        parts[-1].columns = parts[-1].columns.str.replace(r"^(fem|analytic|surrogate)_", "", regex=True)
    return pd.concat(parts).sort_index()
