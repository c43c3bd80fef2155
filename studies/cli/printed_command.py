"""The command line that results print, reconstructed from the call of a verb; it reproduces the results."""

from __future__ import annotations

import dataclasses
import inspect
import shlex
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from cyclopts import App, Parameter

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
            words.append(str(value))
        elif value is True:
            words.append(options[key])
        else:
            # an option that was repeated is printed as often
            each = value if isinstance(value, list) else [value]
            words += [part for one in each for part in _option(options[key], str(one))]
    return shlex.join(words)


def _option(name: str, value: str) -> list[str]:
    """Return the words of an option; a value that begins with a dash is joined to its name."""
    return [f"{name}={value}"] if value.startswith("-") else [name, value]


def _arguments(verb: Callable[..., int], arguments: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any, bool]]:
    """Yield name, value and default of each argument, and whether it is positional; groups are split into options."""
    for key, parameter in inspect.signature(verb).parameters.items():
        if key in LEFT_OUT:
            continue
        value, default = arguments[key], parameter.default
        if dataclasses.is_dataclass(default):
            for field in dataclasses.fields(default):
                yield field.name, getattr(value, field.name), getattr(default, field.name), False
        else:
            yield key, value, default, parameter.kind is parameter.POSITIONAL_ONLY
