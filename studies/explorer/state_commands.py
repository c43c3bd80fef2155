"""The command line and the Python lines that reproduce a state of the explorer."""

from __future__ import annotations

import dataclasses
import shlex
from typing import Any

from analytic import buckling
from geometry.design import PRESETS, Design
from geometry.loads import Load, Magnet
from studies.explorer.explorer_state import ExplorerState, Level, plain
from studies.inputs.option_groups import Motion

OPENING_DEPTH = 1.0
"""Depth of the page's first state for a sensor of the paper's size, mm, and of a page whose address has no depth."""


def commands(state: ExplorerState) -> dict[str, str]:
    """Return the part `commands`: texts for a shell and for Python."""
    return {"shell": shell(state), "python": python(state)}


def shell(state: ExplorerState) -> str:
    """Return the command lines that solve for the state, and for its vibration and loop where it has rates.

    >>> from studies.explorer.explorer_state import state_of
    >>> shell(state_of({"design": {"D": 10}, "load": {"depth": 1, "shear": -2}}))
    'magtip solve paper --depth 1 --shear=-2 --friction stick --set D=10'
    >>> shell(state_of({"load": {"depth": 1, "frequency": 600, "speed": 2}})).splitlines()[1:]
    ['magtip response paper --depth 1 --frequencies 1:600', 'magtip cycle paper --depth 1 --speed 2']
    """
    return "\n".join([_solve_line(state), *_rate_lines(state)])


def without_load(design: Design, magnet: Magnet, level: Level) -> dict[str, str]:
    """Return both texts for a design without load, in which the page without a server puts options and `Load()`."""
    state = ExplorerState("paper", design, Load(), Motion(depth=0.0), magnet, level)
    return {"shell": line("solve", state, {}), "python": python(state)}


def _rate_lines(state: ExplorerState) -> list[str]:
    """Return the command lines of vibration and loop, where the verbs can make them."""
    load, lines = state.load, []
    own: dict[str, Any] = {"--depth": load.depth, "--shear": load.shear_x or None}
    if state.frequency:
        band = ":".join(plain(value) for value in sorted({state.frequency, band_end(state.frequency)}))
        friction = friction_text(state.vibrating_load)
        own_friction = None if friction == "stick" or not load.depth else friction
        more = {"--frequencies": band, "--friction": own_friction, "--plate-tilt": state.motion.plate_tilt or None}
        lines.append(line("response", state, own | {"--shear-y": load.shear_y or None} | more))
    if state.speed and not load.plate_tilt and not load.shear_y and load.depth:
        contact = friction_text(load) if load.coulomb is not None else None
        lines.append(line("cycle", state, own | {"--speed": state.speed, "--friction": contact}))
    return lines


def band_end(frequency: float) -> float:
    """Return the other end of a band that begins or ends at a frequency, Hz."""
    return 1.0 if frequency > 1 else 1000.0


def _solve_line(state: ExplorerState) -> str:
    """Return the command line that solves for the state."""
    motion = state.motion
    options: dict[str, Any] = {"--depth": motion.depth, "--shear": motion.shear, "--shear-y": motion.shear_y}
    options["--plate-tilt"] = motion.plate_tilt or None
    options["--friction"] = friction_text(state.load) if state.load.shear or state.load.coulomb else None
    return line("solve", state, options)


def line(verb: str, state: ExplorerState, options: dict[str, Any]) -> str:
    """Return a command line with options, those that are None left out, and with what all verbs take of a state."""
    options["--magnet"] = None if state.magnet == "rigid" else state.magnet
    options["--accuracy"] = None if state.level == "standard" else state.level
    words = ["magtip", verb, state.preset]
    for name, value in options.items():
        if value is not None:
            text = plain(value)
            # a value that begins with a dash is joined to its option
            words += [f"{name}={text}"] if text.startswith("-") else [name, text]
    for name, value in changed_fields(state).items():
        words += ["--set", f"{name}={plain(value)}"]
    return shlex.join(words)


def friction_text(load: Load) -> str:
    """Return the friction of a load as --friction takes it."""
    return plain(load.friction)


def changed_fields(state: ExplorerState) -> dict[str, float | str]:
    """Return the fields of the design that differ from its preset."""
    base = PRESETS[state.preset]()
    names = [spec.name for spec in dataclasses.fields(base)]
    return {name: getattr(state.design, name) for name in names if getattr(state.design, name) != getattr(base, name)}


def python(state: ExplorerState) -> str:
    """Return the lines of Python that solve for the state, read the Hall elements, and vibrate where it has rates."""
    accuracy, has_magnet = state.level.upper(), state.design.shape.has_magnet
    fields = "".join(f", {name}={_literal(value)}" for name, value in changed_fields(state).items())
    magnet = "" if state.magnet == "rigid" else f', magnet="{state.magnet}"'
    vibrates, about = bool(state.frequency), _load_source(state.vibrating_load)
    band = ", ".join(plain(value) for value in sorted({state.frequency, band_end(state.frequency)}))
    lines = [
        "from dataclasses import replace\n" if fields else "",
        "from analytic import hall" if has_magnet else "",
        f"from fem.accuracy import {accuracy}",
        "from fem.equilibrium import solve",
        "from fem.analyses.vibration import vibrating_sensor" if vibrates else "",
        f"from geometry.design import {state.preset}",
        "from geometry.loads import Load\n",
        f"design = replace({state.preset}(){fields})" if fields else f"design = {state.preset}()",
        f"state = solve(design, {_load_source(state.load)}, {accuracy}{magnet})",
        "print(state.status, state.message)",
        "print(state.response)",
        "print(hall.readings(design, state.response).output)" if has_magnet else "",
        f"sensor = vibrating_sensor(design, {about}, ({band}), {accuracy}{magnet})" if vibrates else "",
        f"print(sensor.at([{plain(state.frequency)}]).force)" if vibrates else "",
    ]
    return "".join(f"{line}\n" for line in lines if line)


def address_fields(design: Design) -> dict[str, str]:
    """Return the fields of the address of a design: those that differ from the preset paper, and its first depth.

    >>> address_fields(Design(D=10))
    {'preset': 'paper', 'D': '10'}
    >>> address_fields(Design(L=32, l0=30))
    {'preset': 'paper', 'L': '32', 'l0': '30', 'depth': '0.32'}
    """
    base = PRESETS["paper"]()
    names = [spec.name for spec in dataclasses.fields(base)]
    changed = {name: plain(getattr(design, name)) for name in names if getattr(design, name) != getattr(base, name)}
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
    """Return a value as Python source."""
    return f'"{value}"' if isinstance(value, str) else "None" if value is None else plain(value)
