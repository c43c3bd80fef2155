"""Designs and loads on which the error estimates of `fem` are calibrated and tested.

The twelve designs are the paper's and eleven of a Sobol sequence over D, L/D, nu and the magnet's three lengths, with
silicone walls of 0.06 D or more. Each is solved with its magnet rigid and with it ignored. The form of the estimates'
rules was chosen on the even-numbered designs; their constants were then widened to hold on all. Shares are therefore
also given for the odd designs alone.
"""

import csv
import functools
from collections.abc import Mapping, Sequence
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
SCENES: dict[str, dict[str, Any]] = {
    "press": {"presses": (0.12, 0.4, 1.0)},
    "deep": {"deep": (0.25, 0.5, 1.0)},
    "stick": {"under": (0.1,), "shears": (0.0, 0.05, STICK_SHEAR)},
    "far": {"under": (0.1,), "shears": (0.3, FAR_SHEAR)},
    "friction": {"under": (0.1,), "shears": (0.0, 0.04, FRICTION_SHEAR), "coefficients": (0.4,)},
    "critical": {"room": (DEEPEST,)},
    "small shear": {"presses": (0.1 / PRESS_DEPTH, 1.0)},
    "modes": {"presses": (0.0, 1.0)},
}
"""Loads of the scenes, as `loads_of` takes them; those of friction are for partial and full slip."""
GRIP = (0.2, STICK_SHEAR)
"""Height and shear of a grip over D."""
TANGENT_SCENES = ("critical", "small shear", "modes")
"""Scenes that follow from a tangent about a press: critical depths, small shears of a glued plate, frequencies."""


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
    loads = [Load(grip=rounded(GRIP[0] * design.D), shear_x=rounded(GRIP[1] * design.D))]
    if scene != "grip":
        loads = loads_of(design, magnet, SCENES[scene])
    return Trial(number, design, magnet, scene, model, tuple(loads))


def loads_of(design: Design, magnet: Magnet, scene: Mapping[str, Any], turn: int = 0) -> list[Load]:
    """Return presses, or shears at one depth, of a design.

    Presses are `presses` over the deepest depth of scene press, which is D/4 or less; `deep`, 0 at that depth and 1
    at the deepest one of the study; and `room`, over the silicone above or below the magnet. Shears have depths
    `under` and `shears` over D, and `coefficients` of friction (default: a plate that sticks); of several depths and
    coefficients the `turn` takes one.
    """
    D, (first, most) = design.D, press_limits(design, magnet)
    room = design.L - design.magnet_height * (magnet == "rigid")
    depths = [share * first for share in scene.get("presses", ())]
    depths += [first + share * (most - first) for share in scene.get("deep", ())]
    depths += [share * room for share in scene.get("room", ())]
    if depths:
        return [Load(depth=rounded(each)) for each in depths]
    under, frictions = scene["under"], scene.get("coefficients", ("stick",))
    depth, friction = rounded(min(under[turn % len(under)] * D, first)), frictions[turn % len(frictions)]
    return [Load(depth=depth, shear_x=rounded(x * D), friction=friction) for x in scene["shears"]]


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
