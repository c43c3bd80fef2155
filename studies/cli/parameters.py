"""Options of several verbs and what they mean: the design, where the result goes, and the command that made it."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import itertools
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from geometry.design import PRESETS, Design
from geometry.loads import Magnet
from studies.inputs import user_input
from studies.output import console
from studies.output.result import Destination

Source = Annotated[
    str, Parameter(name="DESIGN", help=f"Name of a preset ({', '.join(PRESETS)}) or path of a TOML file.")
]
Sets = Annotated[
    list[str] | None, Parameter(name="--set", help="Override a field of the design, KEY=VALUE; repeatable.")
]
AsJson = Annotated[bool, Parameter(name="--json", help="Print JSON only, one object per line.")]
Wide = Annotated[
    bool,
    Parameter(name="--wide", help="Show all columns of a table; default: as many main columns as fit."),
]
KEYWORD, POSITIONAL = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.POSITIONAL_ONLY


class Call:
    """A call of a verb, and what those of its arguments mean that several verbs have.

    arguments : all arguments of the verb by their names.
    arrays : whether the verb takes a table [array] of the design file for what it is.
    """

    def __init__(self, verb: Callable[..., int], arguments: Mapping[str, Any], *, arrays: bool = False) -> None:
        self.verb, self.arguments, self.arrays = verb, arguments, arrays
        self.source = str(arguments.get("source") or "")
        self.sets: list[str] = arguments.get("sets") or []
        self.out: Path | None = arguments.get("out")
        self.as_json, self.wide = bool(arguments.get("as_json")), bool(arguments.get("wide"))

    @property
    def command(self) -> str:
        """The command line."""
        return command(self.verb, self.arguments)

    @property
    def screen(self) -> Destination:
        """The terminal alone."""
        return Destination(as_json=self.as_json, wide=self.wide)

    def here(self, names: Sequence[str] = (), inputs: Sequence[str | Path | None] = ()) -> Destination:
        """Return where the result goes; `names` and `inputs` as in `Destination`, but the design is an input too."""
        inputs = (self.arguments.get("source"), *inputs)
        command = self.command if self.out else ""
        return replace(self.screen, command=command, out=self.out, inputs=inputs, names=names)

    def design(self, magnet: Magnet = "rigid", **unused: float) -> Design:
        """Read the design, and warn of fields without effect and of values that no silicone has.

        Of an array it is that of one beam, which is said unless the verb takes arrays.

        `unused`: as in `user_input.read_design`.
        """
        design = user_input.read_design(self.source, self.sets, magnet=magnet, unused=unused)
        if not self.arrays:
            user_input.say_if_array(self.source)
        user_input.warn_of_values(design)
        return design


COMMON = {
    name: inspect.Parameter(name, KEYWORD, default=default, annotation=kind)
    for name, kind, default in (
        ("sets", Sets, None),
        ("wide", Wide, False),
        ("as_json", AsJson, False),
    )
} | {"source": inspect.Parameter("source", POSITIONAL, annotation=Source)}
"""Arguments of several verbs."""


def verb(
    common: str = "", *, out: str = "", at: int = 99, arrays: bool = False
) -> Callable[[Callable[..., int]], Callable[..., int]]:
    """Return a decorator that adds some of `COMMON` to a verb, which gets its `Call` and its own arguments.

    `out`: help of --out, and `at` the number of the verb's own arguments before it; default: all of them.
    `arrays`: as in `Call`.
    """

    def decorate(function: Callable[..., int]) -> Callable[..., int]:
        _, *own = inspect.signature(function, eval_str=True).parameters.values()
        more = [COMMON[name] for name in common.split()]
        if out:
            kind = Annotated[Path | None, Parameter(help=out)]
            own.insert(at, inspect.Parameter("out", KEYWORD, default=None, annotation=kind))
        parts = sorted([*own, *more], key=lambda one: (one.kind, one.name != "source"))
        signature = inspect.Signature(parts, return_annotation=int)

        def called(*words: Any, **given: Any) -> int:
            bound = signature.bind(*words, **given)
            bound.apply_defaults()
            call = Call(called, dict(bound.arguments), arrays=arrays)
            taken = [one for one in own if not (one.name == "out" and out)]
            values = [bound.arguments[one.name] for one in taken if one.kind is POSITIONAL]
            named = {one.name: bound.arguments[one.name] for one in taken if one.kind is not POSITIONAL}
            return function(call, *values, **named)

        functools.update_wrapper(called, function, ("__module__", "__name__", "__doc__"), ())
        called.__annotations__ = {name: one.annotation for name, one in signature.parameters.items()}
        vars(called)["__signature__"] = signature
        del vars(called)["__wrapped__"]
        return called

    return decorate


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
    """Return the command line that calls a verb with all these arguments, quoted for a shell, without defaults."""
    app = App(default_parameter=Parameter(negative=""))
    app.command(verb)
    (name,) = (name for name in app if app[name].default_command is verb)
    options = {each.field_info.name: each.name for each in app[name].assemble_argument_collection()}
    words = ["magtip", *(["validate"] if verb.__module__ == VALIDATION else []), name]
    for key, parameter in inspect.signature(verb).parameters.items():
        if key in LEFT_OUT:
            continue
        for own, one, default in _options_of(key, arguments[key], parameter.default):
            texts = list(map(str, one if isinstance(one, list) else [one]))
            if one == default:
                continue
            if parameter.kind is POSITIONAL:
                words += texts
            elif one is True:
                words.append(options[own])
            else:
                # an option that was repeated is printed as often
                words += [
                    part
                    for text in texts
                    for part in ([f"{options[own]}={text}"] if text.startswith("-") else [options[own], text])
                ]
    return shlex.join(words)


def _options_of(name: str, value: Any, default: Any) -> list[tuple[str, Any, Any]]:
    """Return name, value and default of each option of a group and of the groups in it, or of a single option."""
    if isinstance(value, dict):
        return [(key, one, None) for key, one in value.items()]
    if not dataclasses.is_dataclass(value):
        return [(name, value, default)]
    groups = [_options_of(each.name, getattr(value, each.name), each.default) for each in dataclasses.fields(value)]
    return list(itertools.chain.from_iterable(groups))
