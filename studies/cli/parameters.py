"""Options of several verbs and what they mean: the design, where the result goes, and the command that made it."""

from __future__ import annotations

import dataclasses
import inspect
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from geometry.design import Design
from geometry.loads import Magnet
from studies.inputs import user_input
from studies.inputs.option_groups import Whole
from studies.output import console
from studies.output.result import Destination

Source = Annotated[str, Parameter(name="DESIGN", help="Name of a preset (paper) or path of a TOML file.")]
Sets = Annotated[
    list[str] | None, Parameter(name="--set", help="Override a field of the design, KEY=VALUE; repeatable.")
]
AsJson = Annotated[bool, Parameter(name="--json", help="Print JSON only, one object per line.")]
Wide = Annotated[
    bool,
    Parameter(name="--wide", help="Show all columns of a table; default: as many main columns as fit."),
]

OwnStore = Annotated[
    Path | None,
    Parameter(
        help="File of solved states; default: that of the user, which the environment variable MAGTIP_STORE can name."
    ),
]
Workers = Annotated[Whole | None, Parameter(help="Number of processes that solve; default: one for each core.")]
Scheduler = Annotated[str | None, Parameter(help="Address of a Dask scheduler whose workers solve.")]


def design_of(source: str, sets: Sequence[str] | None, magnet: Magnet = "rigid") -> Design:
    """Read a design and warn of fields without effect and of values that no silicone has."""
    design = user_input.read_design(source, sets or [], magnet=magnet)
    user_input.warn_of_values(design)
    return design


def destination(
    verb: Callable[..., int],
    arguments: Mapping[str, Any],
    names: Sequence[str] = (),
    inputs: Sequence[str | Path | None] = (),
) -> Destination:
    """Return where the result of a verb goes.

    Parameters
    ----------
    arguments : all arguments of the verb by their names, as `locals()` returns them before one of them is changed.
    names, inputs : of `Destination`; the verb's argument `source` is an input too.
    """
    return Destination(
        command=command(verb, arguments) if arguments.get("out") else "",
        out=arguments.get("out"),
        inputs=(arguments.get("source"), *inputs),
        names=names,
        as_json=arguments.get("as_json", False),
        wide=arguments.get("wide", False),
    )


def say_if_without_magnet(design: Design) -> None:
    """Print a sentence if the design has no magnet, because `--magnet rigid` then has no effect."""
    if not design.shape.has_magnet:
        console.say("magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone")


# The command line that results print

LEFT_OUT = ("as_json", "wide")
"""Arguments that change the output on the screen but not the results."""
VALIDATION = "studies.cli.validation_commands"
"""Module whose functions are studies of the verb validate."""


def command(verb: Callable[..., int], arguments: Mapping[str, Any]) -> str:
    """Return the command line that calls a verb with these arguments, quoted for a shell, without defaults.

    Parameters
    ----------
    arguments : all arguments of the verb by their names, as `locals()` returns them in the verb's first line.
    """
    app = App(default_parameter=Parameter(negative=""))
    app.command(verb)
    (name,) = (name for name in app if app[name].default_command is verb)
    options = {each.field_info.name: each.name for each in app[name].assemble_argument_collection()}
    words = ["magtip", *(["validate"] if verb.__module__ == VALIDATION else []), name]
    for key, value, default, positional in _arguments(verb, arguments):
        if value == default:
            continue
        if positional:
            words += map(str, value if isinstance(value, list) else [value])
        elif value is True:
            words.append(options[key])
        else:
            # an option that was repeated is printed as often
            each = value if isinstance(value, list) else [value]
            words += [part for one in each for part in _option(options[key], str(one))]
    return shlex.join(words)


def _option(name: str, value: str) -> list[str]:
    return [f"{name}={value}"] if value.startswith("-") else [name, value]


def _arguments(verb: Callable[..., int], arguments: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any, bool]]:
    """Yield name, value and default of each argument, and whether it is positional; groups are split into options."""
    for key, parameter in inspect.signature(verb).parameters.items():
        if key in LEFT_OUT:
            continue
        value, default = arguments[key], parameter.default
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                yield field.name, getattr(value, field.name), field.default, False
        else:
            yield key, value, default, parameter.kind is parameter.POSITIONAL_ONLY
