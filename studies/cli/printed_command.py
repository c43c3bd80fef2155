"""The command line of a call of a verb, as results print it: given again, it makes the same."""

from __future__ import annotations

import dataclasses
import inspect
import shlex
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from cyclopts import App, Parameter

LEFT_OUT = ("as_json", "wide")
"""Arguments that change what the screen shows, not what is made."""


def command(verb: Callable[..., int], given: Mapping[str, Any]) -> str:
    """The command line that calls a verb with such arguments, quoted for a shell; defaults are left out.

    Parameters
    ----------
    given : all arguments of the verb by their names, as `locals()` gives them in its first line.
    """
    app = App(default_parameter=Parameter(negative=""))
    app.command(verb)
    (name,) = (name for name in app if app[name].default_command is verb)
    options = {each.field_info.name: each.name for each in app[name].assemble_argument_collection()}
    words = ["magtip", name]
    for key, value, default, positional in _arguments(verb, given):
        if value == default:
            continue
        if positional:
            words.append(str(value))
        elif value is True:
            words.append(options[key])
        else:
            # one word, for a value may begin with a dash
            each = value if isinstance(value, list) else [value]
            words += [part for one in each for part in _option(options[key], str(one))]
    return shlex.join(words)


def _option(name: str, value: str) -> list[str]:
    return [f"{name}={value}"] if value.startswith("-") else [name, value]


def _arguments(verb: Callable[..., int], given: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any, bool]]:
    """Name, value, default and whether it has no name on the command line; groups of options one by one."""
    for key, parameter in inspect.signature(verb).parameters.items():
        if key in LEFT_OUT:
            continue
        value, default = given[key], parameter.default
        if dataclasses.is_dataclass(default):
            for field in dataclasses.fields(default):
                yield field.name, getattr(value, field.name), getattr(default, field.name), False
        else:
            yield key, value, default, parameter.kind is parameter.POSITIONAL_ONLY
