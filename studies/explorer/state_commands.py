"""The command line and the Python lines that reproduce a state of the explorer."""

from __future__ import annotations

import dataclasses
import shlex
from typing import Any

from geometry.design import PRESETS, Design
from geometry.loads import Load
from studies.explorer.explorer_state import ExplorerState, plain


def commands(state: ExplorerState) -> dict[str, str]:
    """Return the part `commands`: texts for a shell and for Python."""
    return {"shell": shell(state), "python": python(state)}


def shell(state: ExplorerState) -> str:
    """Return the command line that solves for the state.

    >>> from studies.explorer.explorer_state import state_of
    >>> shell(state_of({"design": {"D": 10}, "load": {"depth": 1, "shear": -2}}))
    'magtip solve paper --depth 1 --shear=-2 --friction stick --set D=10'
    """
    motion = state.motion
    options: dict[str, Any] = {"--depth": motion.depth, "--shear": motion.shear, "--shear-y": motion.shear_y}
    options["--plate-tilt"] = motion.plate_tilt or None
    options["--friction"] = friction_text(state.load) if state.load.shear or state.load.coulomb else None
    options["--magnet"] = None if state.magnet == "rigid" else state.magnet
    options["--accuracy"] = None if state.level == "standard" else state.level
    words = ["magtip", "solve", state.preset]
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
    """Return the lines of Python that solve for the state and read the Hall elements."""
    accuracy, has_magnet = state.level.upper(), state.design.shape.has_magnet
    fields = "".join(f", {name}={_literal(value)}" for name, value in changed_fields(state).items())
    load = ", ".join(
        f"{spec.name}={_literal(getattr(state.load, spec.name))}"
        for spec in dataclasses.fields(Load)
        if getattr(state.load, spec.name) != spec.default
    )
    magnet = "" if state.magnet == "rigid" else f', magnet="{state.magnet}"'
    lines = [
        "from dataclasses import replace\n" if fields else "",
        "from analytic import hall" if has_magnet else "",
        f"from fem.accuracy import {accuracy}",
        "from fem.equilibrium import solve",
        f"from geometry.design import {state.preset}",
        "from geometry.loads import Load\n",
        f"design = replace({state.preset}(){fields})" if fields else f"design = {state.preset}()",
        f"state = solve(design, Load({load}), {accuracy}{magnet})",
        "print(state.status, state.message)",
        "print(state.response)",
        "print(hall.readings(design, state.response).output)" if has_magnet else "",
    ]
    return "".join(f"{line}\n" for line in lines if line)


def address_fields(design: Design) -> dict[str, str]:
    """Return the fields of the address of a design: those that differ from the preset paper.

    >>> address_fields(Design(D=10))
    {'preset': 'paper', 'D': '10'}
    """
    base = PRESETS["paper"]()
    names = [spec.name for spec in dataclasses.fields(base)]
    changed = {name: plain(getattr(design, name)) for name in names if getattr(design, name) != getattr(base, name)}
    return {"preset": "paper", **changed} if changed else {}


def _literal(value: float | str | None) -> str:
    """Return a value as Python source."""
    return f'"{value}"' if isinstance(value, str) else "None" if value is None else plain(value)
