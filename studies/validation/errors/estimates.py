"""Random designs and loads of the whole permitted range, on which the error estimates of `fem` rest.

Draw k of a kind of load has a random generator of its own, so that any draw can be made alone. Forces are
proportional to E D^2 and lengths to D, so E is 1 MPa; D decides which magnets leave the least wall. The constants of
the rules are taken from two draws in three; the third, which nothing rests on, tests them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fem import equilibrium
from fem.accuracy import COARSER, FINE, QUICK, STANDARD, Accuracy, coarser
from fem.physics_version import PHYSICS
from fem.results.error_estimates import NUMBERS, estimate_numbers_of, load_case, numbers_of
from fem.scene import LEAST_SPOT, Model, Scene, press_limits
from geometry.bad_input import BadInput, SolveFailed
from geometry.design import Design
from geometry.loads import Load, Magnet, Response, check_load
from geometry.messages import Progress
from studies.output.figures import picture
from studies.output.result import Result, Table
from studies.validation import pages
from studies.validation.errors import error_table
from studies.validation.errors.error_table import RESPONSES
from studies.validation.pages import Row
from studies.web import verdict_figures

SOLVED: tuple[Model, ...] = ("axisymmetric", "harmonic")
SEED = 2047
SLENDERNESS, DIAMETERS = (0.56, 5.0), (1.0, 40.0)
"""L / D, and D in mm."""
NO_MAGNET, INCOMPRESSIBLE, SHARP = 0.25, 0.5, 0.15
"""Shares of the draws without a magnet, with nu from 0.49 to 0.5, and with magnets of sharp edges."""
LEAST_MAGNET = 0.03
"""Least radius and half height of a magnet over D."""
STEEPEST_DEG = 20.0
MOST_TRIES = 200
NEVER_SEEN = 3
"""Of so many draws one is never used for a constant."""
OF_REFERENCE = 1 / (COARSER**2 - 1)
"""Error of a reference over its difference to the mesh coarser than it: errors fall with the square of the edge."""
COLUMNS = (*dict.fromkeys(name for names in RESPONSES.values() for name in names), *NUMBERS)
NOTHING = 1e-6
"""Length over D, angle in rad or force over E D^2 below which a relative error has no meaning."""


class Draw(NamedTuple):
    """One state: kind of load and number of the draw, the design with its magnet, and the load.

    The state of kind pressed is the press before a load, on the mesh of its shear.
    """

    kind: str
    number: int
    design: Design
    magnet: Magnet
    load: Load

    @property
    def loads(self) -> tuple[Load, ...]:
        """The path of loads, of which the first one is measured."""
        return (replace(self.load, shear_x=0.0), self.load) if self.kind == "pressed" else (self.load,)

    @property
    def unseen(self) -> bool:
        """Whether no constant of the rules is taken from it."""
        return self.number % NEVER_SEEN == NEVER_SEEN - 1

    @property
    def upright(self) -> bool:
        """Whether it is an axisymmetric press, whose reference is cheap."""
        return self.kind in UPRIGHT


def draw(kind: str, number: int) -> Draw:
    """Return a draw of one of KINDS; designs whose loads are refused are drawn again."""
    rng = np.random.default_rng([SEED, STREAMS.index(kind), number])
    for _ in range(MOST_TRIES):
        try:
            design = random_design(rng)
            magnet: Magnet = "rigid" if design.magnet_diameter else "ignored"
            load = KINDS[kind](rng, design, magnet)
            check_load(design, load, magnet)
        except BadInput:
            continue
        return Draw(kind, number, design, magnet, load)
    raise RuntimeError(f"no design of {MOST_TRIES} takes a load of kind {kind}")


def random_design(rng: np.random.Generator) -> Design:
    D = _rounded(_between(rng, *DIAMETERS))
    L = _rounded(D * _between(rng, *SLENDERNESS))
    fields: dict[str, Any] = {"D": D, "L": L, "E": 1.0} | _random_law(rng)
    fields["nu"] = rng.uniform(0.49, 0.5) if rng.random() < INCOMPRESSIBLE else rng.uniform(0.0, 0.5)
    fields["nu"] = round(fields["nu"], 5)
    if rng.random() < NO_MAGNET:
        return Design(**fields, magnet_diameter=0.0, magnet_height=0.0)
    centre = L - D / 2
    a, b = (_between(rng, LEAST_MAGNET * D, most) for most in (D / 2, min(D / 2, max(centre, LEAST_MAGNET * D))))
    edge = 0.0 if rng.random() < SHARP else rng.uniform(0.0, 0.6) * min(a, b)
    fields |= {"magnet_diameter": _rounded(2 * a), "magnet_height": _rounded(2 * b)}
    return Design(**fields, magnet_edge_radius=float(f"{edge:.3g}"))


def _random_law(rng: np.random.Generator) -> dict[str, Any]:
    law = str(rng.choice(["neo-hookean", "mooney-rivlin", "yeoh", "ogden"]))
    constants = {
        "neo-hookean": {},
        "mooney-rivlin": {"mooney_share": rng.uniform(0.05, 0.9)},
        "yeoh": {"yeoh_2": rng.uniform(0.0, 0.4), "yeoh_3": rng.uniform(0.0, 0.1)},
        "ogden": {
            "ogden_alpha1": rng.uniform(1.0, 6.0),
            "ogden_alpha2": -rng.uniform(1.0, 6.0),
            "ogden_share": rng.uniform(0.0, 0.6),
        },
    }
    return {"law": law} | {name: round(value, 4) for name, value in constants[law].items()}


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number from low to high whose logarithm is evenly distributed."""
    if not low < high:
        raise BadInput(f"no number lies between {low:g} and {high:g}")
    return float(low * (high / low) ** rng.random())


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


# Loads


def _depth(rng: np.random.Generator, design: Design, magnet: Magnet, low: float, high: float) -> float:
    """Return a depth between two ones over D, at most the deepest one of scene press."""
    return _rounded(_between(rng, low * design.D, min(high * design.D, press_limits(design, magnet)[0])))


def _light(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    return Load(_depth(rng, design, magnet, 0.001, 0.03))


def _press(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    return Load(_depth(rng, design, magnet, 0.03, 0.25))


def _deep(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    return Load(_rounded(rng.uniform(*press_limits(design, magnet))))


def _sheared(low: float, high: float, friction: bool = False) -> Callable[..., Load]:
    def load(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
        depth, shear = _depth(rng, design, magnet, 0.02, 0.2), _rounded(design.D * _between(rng, low, high))
        mu: Any = _random_friction(rng) if friction else "stick"
        return Load(depth, shear, friction=mu)

    return load


def _random_friction(rng: np.random.Generator) -> float:
    return float(f"{_between(rng, 0.03, 1.0):.3g}")


def _grip(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    """Return a grip from a spot at the tip to nine tenths of the beam, and a shear."""
    height = _between(rng, max(4 * LEAST_SPOT**2, 0.02) * design.D, 0.9 * design.L)
    return Load(grip=_rounded(height), shear_x=_rounded(design.D * _between(rng, 0.01, 0.3)))


def _rubbed(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    return Load(_depth(rng, design, magnet, 0.005, 0.25), friction=_random_friction(rng))


def _tilted(rng: np.random.Generator, design: Design, magnet: Magnet) -> Load:
    """Return a tilted plate without a shear, or one that sticks or rubs along the tilt, in equal shares."""
    tilt = _rounded(math.radians(rng.uniform(1.0, STEEPEST_DEG)))
    depth, way = _depth(rng, design, magnet, 0.03, 0.2), int(rng.integers(3))
    shear = _rounded(design.D * _between(rng, 0.01, 0.15)) if way else 0.0
    friction: Any = ("none", "stick", _random_friction(rng))[way]
    return Load(depth, shear, friction=friction, plate_tilt=tilt)


KINDS: dict[str, Callable[[np.random.Generator, Design, Magnet], Load]] = {
    "light press": _light,
    "press": _press,
    "deep press": _deep,
    "pressed": _sheared(0.01, 0.15),
    "glued shear": _sheared(0.01, 0.15),
    "far glued shear": _sheared(0.15, 0.6),
    "grip": _grip,
    "friction press": _rubbed,
    "friction shear": _sheared(0.02, 0.25, friction=True),
    "tilted plate": _tilted,
}
VERSIONS = " ".join(f"{name} {PHYSICS[name]}" for name in SOLVED)
"""Versions of the models that solve the states."""
FILES = ("ESTIMATES.md", "estimates.csv", "random_states.csv", "estimates.png", "error_rules.csv")
FEW = {"press": 2, "glued shear": 1, "grip": 1}
"""Numbers of draws of a quick run."""
COUNTS = {
    "light press": 60,
    "press": 60,
    "deep press": 60,
    "pressed": 30,
    "glued shear": 42,
    "far glued shear": 30,
    "grip": 42,
    "friction press": 48,
    "friction shear": 30,
    "tilted plate": 30,
}
"""Numbers of draws of each kind."""
STREAMS = (
    *("deep press", "far glued shear", "friction press", "friction shear", "glued shear", "grip"),
    *("light press", "press", "tilted plate", "pressed"),
)
"""Kinds in the order of their streams of random numbers; a new one comes last, so that the others stay."""
UPRIGHT = ("light press", "press", "deep press", "pressed", "friction press")


def run(progress: Progress, *, quick: bool = False, states: Path | None = None) -> Result:
    """Hold the error estimates of random states against finer meshes; exit status 3 if a goal is missed.

    Parameters
    ----------
    quick
        Use four states: some seconds instead of an hour.
    states
        Table random_states.csv of an earlier run: the states in it are not solved again.
    """
    drawn = solved(FEW if quick else COUNTS, states, progress)
    return result(compare(drawn), drawn, "quick" if quick else "full")


def result(rows: pd.DataFrame, drawn: pd.DataFrame, run: str) -> Result:
    shares, levels = error_table.shares(rows), error_table.summary(rows)
    numbers = drawn.groupby("kind", sort=False).number.nunique()
    page = {
        "kinds": [{"kind": kind, "states": int(numbers[kind])} for kind in numbers.index],
        "shares": shares,
        "levels": levels,
        "lost": pages.records(rows[rows.status != "ok"]),
        "count": int(numbers.sum()),
        "unseen": len({(row.path, row.design) for row in rows.itertuples() if row.part == "unseen"}),
        "versions": VERSIONS,
    }
    tables = {"Estimates": shares, "Levels": levels}
    first = ("scene", "quantity", "designs", "states", "coverage")
    records = pages.records(rows)
    more: Row = {
        "records": [*shares, *levels],
        "goals": error_table.goals_of_estimates(rows),
        "digits": 7,
        "run": run,
    }
    more["tables"] = {"estimates": records, "random_states": pages.records(drawn)}
    more["tables"] |= {"error_rules": error_table.rules(rows)}
    more["shown"] = [Table(title=title, rows=table, first=first) for title, table in tables.items()]
    files = {"estimates.png": functools.partial(picture, rows=records, draw=verdict_figures.accuracy)}
    return pages.study("estimates", "Error estimates", records, page, files=files, **more)


# States


def solved(counts: Mapping[str, int], file: Path | None = None, progress: Progress | None = None) -> pd.DataFrame:
    """Return the rows of `solve` of the first draws of each kind, those in a table of an earlier run from there.

    counts : number of draws by kind.
    """
    chosen = [(kind, k) for kind in KINDS for k in range(counts.get(kind, 0))]
    kept = pd.DataFrame(columns=["kind", "number"]) if file is None else _read(file)
    have = set(zip(kept.kind, kept.number, strict=True))
    tables = [kept[[each in set(chosen) for each in zip(kept.kind, kept.number, strict=True)]]]
    for done, (kind, number) in enumerate(chosen):
        if progress is not None:
            progress(done / len(chosen), f"{kind} {number}")
        if (kind, number) not in have:
            tables.append(pd.DataFrame(solve(draw(kind, number))))
    return pd.concat([table for table in tables if len(table)], ignore_index=True)


def _read(file: Path) -> pd.DataFrame:
    try:
        table = pd.read_csv(file)
    except (OSError, ValueError) as error:
        raise BadInput(f"--states {str(file)!r} cannot be read ({error}): name a random_states.csv") from None
    lost = [name for name in ("kind", "number", "mesh", "status", "physics", *COLUMNS) if name not in table]
    if lost:
        raise BadInput(f"--states {str(file)!r} has no column {lost[0]}: name a random_states.csv")
    if old := set(table.physics) - {VERSIONS}:
        raise BadInput(
            f"--states {str(file)!r} is of other versions of the physics ({old.pop()}): leave it out to solve again"
        )
    return table.astype({"message": object}).fillna({"message": ""})


def finer(accuracy: Accuracy) -> Accuracy:
    """Return the accuracy whose coarser one has the sections of this one."""
    step, edges = accuracy.friction_step_factor / COARSER, accuracy.coarseness / COARSER
    return replace(accuracy, coarseness=edges, friction_step_factor=step, harmonics=accuracy.harmonics + 1)


def meshes(state: Draw) -> dict[str, Accuracy]:
    """Return the accuracies that a draw is solved with: its levels, its reference, and those coarser than each.

    The reference is finer than level fine for an upright press; for other loads it is fine in one draw of four, and
    otherwise finer than standard.
    """
    levels = (QUICK, STANDARD, FINE) if state.upright else (QUICK, STANDARD)
    truth = finer(FINE) if state.upright else FINE if state.number // 2 % 4 == 0 else finer(STANDARD)
    pairs = {level.name: level for level in levels} | {"reference": truth}
    rough = {f"{name} coarser": coarser(accuracy) for name, accuracy in pairs.items()}
    # the difference of a reference is no estimate but a part of the true error
    exact = replace(rough["reference coarser"], tolerance_factor=truth.tolerance_factor)
    return pairs | rough | {"reference coarser": exact}


def solve(state: Draw) -> list[Row]:
    """Return the row of each solve of a draw: its status, and the numbers of COLUMNS, NaN where there is none."""
    rows = []
    for name, accuracy in meshes(state).items():
        place: Row = {"kind": state.kind, "number": state.number, "mesh": name, "physics": VERSIONS}
        rows.append(place | _solved(state, _section_of(accuracy)))
    return rows


def _section_of(accuracy: Accuracy) -> Accuracy:
    """Return an accuracy that differs only where sections do."""
    return replace(accuracy, name="", solid_size=QUICK.solid_size, solid_patch=QUICK.solid_patch)


@functools.lru_cache(maxsize=16)
def _solved(state: Draw, accuracy: Accuracy) -> Row:
    scene = Scene(state.design, state.loads, accuracy, state.magnet)
    nothing: Row = {"radius_from": None} | dict.fromkeys(COLUMNS, math.nan)
    try:
        found = next(equilibrium.walk(scene, estimate=False))
    except SolveFailed as error:
        return {"status": "failed", "message": str(error)} | nothing
    if found.load != state.loads[0]:
        return {"status": "not_converged", "message": found.message} | nothing
    (x, _, z), (aside, _, sinking) = found.response.force, found.response.shift
    values: Row = {"force_x_N": x, "force_z_N": z, "shift_x_mm": aside, "shift_z_mm": sinking}
    values |= {"tilt_rad": found.response.tilt} | numbers_of(found)
    known = {name: math.nan if value is None else value for name, value in values.items()}
    return {"status": found.status, "message": found.message} | nothing | known | {"radius_from": found.radius_from}


# Errors


def compare(solves: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each draw and level, with its true errors and estimates; NaN where there is none.

    solves : rows of `solve`.
    """
    rows = []
    for (kind, number), table in solves.groupby(["kind", "number"], sort=False):
        state = draw(str(kind), int(str(number)))
        every = {str(row["mesh"]): row for row in table.to_dict("records")}
        for name, accuracy in meshes(state).items():
            if "coarser" not in name and name != "reference" and name in every:
                rows.append(_compared(state, accuracy, every))
    return pd.DataFrame(rows)


def _compared(state: Draw, level: Accuracy, every: Mapping[str, Mapping[Any, Any]]) -> Row:
    scene, load = Scene(state.design, state.loads, level, state.magnet), state.loads[0]
    names = (level.name, f"{level.name} coarser", "reference", "reference coarser")
    found, coarse, truth, rough = (every[name] for name in names)
    row: Row = {
        "design": state.number,
        "part": "unseen" if state.unseen else "fitted",
        "magnet": state.magnet,
        "scene": load_case(load, scene),
        "path": state.kind,
        "model": scene.model,
        "level": level.name,
        "depth_mm": state.load.depth,
        "shear_mm": load.shear_x,
    }
    bad = [f"{name}: {every[name]['status']}: {every[name]['message']}" for name in names if lost(every[name])]
    row |= {"status": every[names[0]]["status"] if lost(found) else "disagrees" if bad else "ok"}
    row["message"] = "; ".join(bad)
    if bad:
        return row
    model = scene.model
    estimates = estimate_numbers_of(
        (_response(found), _numbers(found)), (_response(coarse), _numbers(coarse)), load, scene, model
    )
    for name in (*RESPONSES, *NUMBERS):
        row[f"{name}_error"] = _error(name, state, found, truth, rough)
        value = getattr(estimates, name)
        row[f"{name}_estimate"] = math.nan if value is None else value
    return row


def lost(row: Mapping[Any, Any]) -> bool:
    """Return whether a solve has no answer; whether a tip that slides would be stable does not matter."""
    return row["status"] not in ("ok", "unknown")


def _error(name: str, state: Draw, *solves: Mapping[Any, Any]) -> float:
    """Return the true error of a quantity, with that of the reference added; NaN where the quantity vanishes."""
    columns, D = RESPONSES.get(name, (name,)), state.design.D
    found, truth, rough = (np.array([one[column] for column in columns], dtype=float) for one in solves)
    unit = {"force": D**2, "sideways": D**2, "shift": D}.get(name, 1.0)
    size = 1.0 if name == "slip_share" else float(np.linalg.norm(truth))
    if (name == "sideways" and not state.loads[0].shears_tip) or not size > NOTHING * unit:
        return math.nan
    return float(np.linalg.norm(found - truth) + OF_REFERENCE * np.linalg.norm(truth - rough)) / size


def _response(row: Mapping[Any, Any]) -> Response:
    force, shift = (row["force_x_N"], 0.0, row["force_z_N"]), (row["shift_x_mm"], 0.0, row["shift_z_mm"])
    radius = row["contact_radius"]
    return Response(force, shift, row["tilt_rad"], 0.0 if math.isnan(radius) else radius)


def _numbers(row: Mapping[Any, Any]) -> dict[str, float | None]:
    return {name: None if math.isnan(row[name]) else row[name] for name in NUMBERS}
