"""What reproduces a state of the explorer elsewhere: command lines, Python lines, and the files of the export menu.

Texts of a state are made in the server. Numbers and fields need its solution, which a worker process has. The mould
is that of `magtip cad`, made by a worker process that ends with the request: it loads a CAD library.
"""

from __future__ import annotations

import asyncio
import dataclasses
import shlex
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analytic import buckling
from geometry.compiled import cores
from geometry.design import BadInput, Design
from geometry.loads import Load
from studies.inputs.study_input import values_of
from studies.inputs.user_input import FIELDS, changed_fields, design_text
from studies.mechanics.executor import WorkerDied, WorkerProcess
from studies.output.literals import literal
from studies.output.page_templates import rendered
from studies.sensing.array_readings import array_text
from studies.web.explorer_state import OPENING_DEPTH, ExplorerState, Request, plain

if TYPE_CHECKING:
    from fem.solution import Solution
    from studies.calibration.sensor_fit import Fit

TYPES = {
    "design.toml": "application/toml",
    "mold.zip": "application/zip",
    "state.csv": "text/csv; charset=utf-8",
    "curve.csv": "text/csv; charset=utf-8",
    "fields.vtu": "application/vnd.vtk+xml",
}
"""Names of the exports, and the types of their files."""
PYTHON = Path(__file__).with_name("state_commands.py.j2")
PATIENCE = 300.0
"""Longest time that the mould's process may take, s; it takes some 10 s."""


def commands(state: ExplorerState) -> dict[str, str]:
    """Return the part `commands`: texts for a shell and for Python, and the name of the sensor."""
    return {"shell": shell(state), "python": python(state), "sensor": sensor_name(state.design)}


def design_file(request: Request) -> str:
    """Return the design file of a state, with the array of which it is a beam."""
    text, stated = design_text(request.state.design), request.stated
    return text if stated is None else f"{text}\n{array_text(request.state.array.grid(stated))}"


def sensor_name(design: Design) -> str:
    """Return the name of a design by what differs from the preset paper.

    >>> sensor_name(Design()), sensor_name(Design(D=10, law="yeoh"))
    ("the paper's sensor", "the paper's sensor with D 10 mm, law yeoh")
    """
    changed = []
    for name, value in changed_fields(design).items():
        unit = FIELDS[name].metadata.get("unit", "1")
        changed.append(f"{name} {plain(value)}{'' if unit == '1' else f' {unit}'}")
    return " with ".join(filter(None, ["the paper's sensor", ", ".join(changed)]))


def shell(state: ExplorerState) -> str:
    """Return the command lines that solve for the state, and for its vibration and loop where it has rates.

    >>> from studies.web.explorer_state import state_of
    >>> shell(state_of({"design": {"D": 10}, "load": {"depth": 1, "shear": -2}}))
    'magtip solve paper --depth 1 --shear=-2 --friction stick --set D=10'
    >>> shell(state_of({"load": {"depth": 1, "frequency": 600, "speed": 2}})).splitlines()[1:]
    ['magtip response paper --depth 1 --frequencies 1:600', 'magtip cycle paper --depth 1 --speed 2']
    """
    load = state.load
    moved = {
        # the twelfth digit of degrees is rounding
        f"--{name.replace('_', '-')}": float(f"{value:.12g}") if value else None
        for name, value in values_of(load).items()
        if name != "friction"
    } | {"--depth": load.depth}
    friction = load.friction if load.shear or load.coulomb else None
    lines = [line("solve", state, moved | {"--friction": friction})]
    if state.frequency:
        about = state.vibrating_load.friction
        friction = None if about == "stick" or not load.depth else about
        lines.append(line("response", state, moved | {"--frequencies": _band(state, ":"), "--friction": friction}))
    if state.speed and not load.plate_tilt and not load.shear_y and load.depth:
        friction = load.friction if load.coulomb is not None else None
        along = {name: moved[name] for name in ("--depth", "--shear")}
        lines.append(line("cycle", state, along | {"--speed": state.speed, "--friction": friction}))
    return "\n".join(lines)


def _band(state: ExplorerState, between: str) -> str:
    """Return a band of frequencies, Hz, that begins or ends at that of a state."""
    ends = (state.frequency, 1.0 if state.frequency > 1 else 1000.0)
    return between.join(map(plain, sorted(ends)))


def line(verb: str, state: ExplorerState, options: dict[str, Any]) -> str:
    """Return a command line with options, those that are None left out, and with what all verbs take of a state."""
    options["--magnet"] = None if state.magnet == "rigid" else state.magnet
    options["--accuracy"] = None if state.level == "standard" else state.level
    words = ["magtip", verb, "paper"]
    for name, value in options.items():
        if value is not None:
            text = plain(value)
            # a value that begins with a dash is joined to its option
            words += [f"{name}={text}"] if text.startswith("-") else [name, text]
    for name, value in changed_fields(state.design).items():
        words += ["--set", f"{name}={plain(value)}"]
    return shlex.join(words)


def python(state: ExplorerState) -> str:
    """Return the lines of Python that solve for the state, read the Hall elements, and vibrate where it has rates."""
    fields = "".join(f", {name}={_literal(value)}" for name, value in changed_fields(state.design).items())
    magnet = "" if state.magnet == "rigid" else f", magnet={literal(state.magnet)}"
    values = {"fields": fields, "has_magnet": state.design.shape.has_magnet, "magnet": magnet}
    values |= {"accuracy": state.level.upper(), "load": _load_source(state.load)}
    values |= {"frequency": state.frequency and plain(state.frequency), "about": _load_source(state.vibrating_load)}
    return f"{rendered(PYTHON, **values, band=_band(state, ', '))}\n"


def address_fields(design: Design) -> dict[str, str]:
    """Return the fields of the address of a design: those that differ from the preset paper, and its first depth.

    >>> address_fields(Design(D=10))
    {'preset': 'paper', 'D': '10'}
    >>> address_fields(Design(L=32, l0=30))
    {'preset': 'paper', 'L': '32', 'l0': '30', 'depth': '0.32'}
    """
    changed = {name: plain(value) for name, value in changed_fields(design).items()}
    depth = first_depth(design)
    if depth != OPENING_DEPTH:
        changed["depth"] = plain(depth)
    return {"preset": "paper", **changed} if changed else {}


def first_depth(design: Design) -> float:
    """Return the depth of the page's first state, mm: at most D/8, and half the critical depth by Haringx's formula.

    >>> from geometry.design import paper
    >>> first_depth(paper()), first_depth(Design(D=3, L=8, f=4, magnet_diameter=1.5, magnet_height=1, l0=7))
    (1.0, 0.2)
    """
    critical = buckling.depth(design, buckling.haringx(design))
    return float(f"{min(OPENING_DEPTH, design.D / 8, critical / 2):.2g}")


def _load_source(load: Load) -> str:
    """Return a load as Python source, without the fields that have their default.

    >>> _load_source(Load(depth=1, friction="stick"))
    'Load(depth=1, friction="stick")'
    """
    fields = {spec.name: getattr(load, spec.name) for spec in dataclasses.fields(Load)}
    changed = {spec.name for spec in dataclasses.fields(Load) if fields[spec.name] != spec.default}
    return f"Load({', '.join(f'{name}={_literal(value)}' for name, value in fields.items() if name in changed)})"


def _literal(value: float | str | None) -> str:
    return literal(value) if isinstance(value, str) else "None" if value is None else plain(value)


async def mold(state: ExplorerState) -> bytes:
    """Return the archive of what `magtip cad` writes for a design, or its refusal, by a process that ends with it."""
    command = line("cad", state, {"--out": "mold"})
    process = WorkerProcess(cores())
    try:
        made = asyncio.to_thread(process.call, _mold_archive, (state.design, command))
        content, error, _ = await asyncio.wait_for(made, PATIENCE)
    except TimeoutError:
        raise BadInput(f"the mould took more than {PATIENCE:g} s: use magtip cad") from None
    except WorkerDied as death:
        raise BadInput(f"the process that made the mould ended with {death}: use magtip cad") from None
    finally:
        process.end()
    if error is not None:
        raise error
    assert isinstance(content, bytes)
    return content


def _mold_archive(task: tuple[Design, str]) -> bytes:
    from studies.fabrication.sensor_parts import build
    from studies.fabrication.sensor_solids import FabricationChoices
    from studies.parts.catalogues import mix_named

    design, command = task
    choices = FabricationChoices(silicone=mix_named(None, design.silicone))
    with tempfile.TemporaryDirectory(prefix="magtip-") as folder:
        row = build(design, Path(folder, "mold"), lambda share, text: None, choices, command=command)
        if row["status"] != "ok":
            raise BadInput(row["message"])
        return Path(shutil.make_archive(str(Path(folder, "archive")), "zip", row["folder"])).read_bytes()


def of_solution(name: str, state: ExplorerState, solution: Solution, made: Fit | None = None) -> bytes:
    """Return an export of a solution: the columns of `magtip solve --json` and readings, or the deformed body.

    made : calibrated sensor, whose force and readings these are.
    """
    if name == "fields.vtu":
        from studies.output import vtk_files

        with tempfile.TemporaryDirectory(prefix="magtip-") as folder:
            path = Path(folder, name)
            vtk_files.write_field(path, solution)
            return path.read_bytes()
    from analytic import hall
    from studies.simulation import state_rows

    of_sensor: dict[str, Any] = {}
    if made is not None:
        from studies.web.state_answers import response_of_made_sensor

        response, of_sensor = response_of_made_sensor(solution.response, state.design, made)
        solution = dataclasses.replace(solution, response=response)

    row = state_rows.solved_row(state.design, state.magnet, solution)
    made_for = row.pop("made_for", {})
    if state.design.shape.has_magnet:
        readings = hall.readings(state.design, solution.response)
        row |= {"readings_T": list(readings.B_T), "output": list(readings.output), "units": list(readings.units)}
    row |= of_sensor
    columns: dict[str, Any] = {}
    for key, value in (row | made_for).items():
        parts = value if isinstance(value, (list, tuple)) else None
        columns |= {key: value} if parts is None else {f"{key}_{k}": part for k, part in enumerate(parts, 1)}
    return _csv({key: [value] for key, value in columns.items()})


def of_curve(data: Mapping[str, Any]) -> bytes:
    """Return the curve as a table."""
    widths = data["estimates"]
    columns = {
        "depth_mm": data["depth"],
        "force_N": data["force"],
        "force_half_width_N": widths["force"],
        "shift_mm": data["shift"],
        "shift_half_width_mm": widths["shift"],
    }
    for level, one in data["formulas"].items():
        columns |= {f"{level}_force_N": one["force"], f"{level}_shift_mm": one["shift"]}
    return _csv(columns | {"status": data["status"]})


def _csv(columns: Mapping[str, Any]) -> bytes:
    import pandas as pd

    return bytes(pd.DataFrame(columns).to_csv(index=False, lineterminator="\n"), "utf-8")
