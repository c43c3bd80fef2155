"""The verbs of `magtip validate`: do the answers hold, and what do they cost?

A verb is a sub-package of `studies.validation`, whose docstring is its help. Its parts are the modules with `FILES`
in it: a part is called by the first word of its module, and its function `run` is what it does. The options of a verb
are those of its parts, with the help of their docstrings.
"""

from __future__ import annotations

import inspect
import pkgutil
import re
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

from cyclopts import Parameter

from geometry.bad_input import BadInput
from studies.cli.parameters import KEYWORD, POSITIONAL, Call, verb
from studies.output.result import publish

COMMAND = "command"
"""Argument of a part that is no option: the command line that makes its result again."""


def __getattr__(name: str) -> Callable[..., int]:
    """Return the verb of a sub-package of `studies.validation`."""
    if name.startswith("_"):
        raise AttributeError(name)
    if find_spec(f"studies.validation.{name}") is None:
        raise AttributeError(name)
    package = import_module(f"studies.validation.{name}")
    parts = parts_of(package)
    own = [*_options(parts).values()]
    if len(parts) > 1:
        words = Parameter(name="PART", help=f"Run one part: {', '.join(parts)}; default: all.")
        own.insert(0, inspect.Parameter("part", POSITIONAL, default=None, annotation=Annotated[str | None, words]))

    def run(call: Call, *words: Any, **given: Any) -> int:
        part = call.arguments.get("part")
        if part not in (None, *parts):
            raise BadInput(f"{name} has no part {part}: choose one of {', '.join(parts)}, or leave it out")
        chosen = {key: module for key, module in parts.items() if part in (None, key)}
        _check_options(call, chosen, parts)
        inputs = [value for key, value in call.arguments.items() if key != "out" and isinstance(value, Path)]
        here = call.here([file for module in chosen.values() for file in module.FILES], inputs)
        known = {**call.arguments, COMMAND: here.command}
        studies = {
            key: partial(module.run, **{one.name: known[one.name] for one in arguments(module)})
            for key, module in chosen.items()
        }
        return publish(partial(import_module("studies.validation.pages").report, studies=studies), here)

    run.__name__, run.__doc__ = name, package.__doc__
    vars(run)["__signature__"] = inspect.Signature([inspect.Parameter("call", POSITIONAL), *own])
    return verb("wide as_json", out="Folder for the pages, tables and pictures.")(run)


def parts_of(package: ModuleType) -> dict[str, ModuleType]:
    modules = [import_module(f"{package.__name__}.{each.name}") for each in pkgutil.iter_modules(package.__path__)]
    names = {module: module.__name__.rpartition(".")[2].partition("_")[0] for module in modules}
    return {name: module for module, name in names.items() if hasattr(module, "FILES")}


def arguments(part: ModuleType) -> Sequence[inspect.Parameter]:
    """Return the arguments of a part behind its progress."""
    return list(inspect.signature(part.run, eval_str=True).parameters.values())[1:]


def _options(parts: dict[str, ModuleType]) -> dict[str, inspect.Parameter]:
    """Return the options of some parts: one that several have has the help of each."""
    found: dict[str, inspect.Parameter] = {}
    helps: dict[str, dict[str, list[str]]] = {}
    for part, module in parts.items():
        texts = dict(re.findall(r"^(\w+)\n((?:    .+\n?)+)", inspect.getdoc(module.run) or "", re.MULTILINE))
        for one in arguments(module):
            if one.name != COMMAND:
                found.setdefault(one.name, one)
                text = " ".join(texts.get(one.name, "").split())
                helps.setdefault(one.name, {}).setdefault(text, []).append(part)
    for name, one in found.items():
        said = [text if len(own) == len(parts) else f"{', '.join(own)}: {text}" for text, own in helps[name].items()]
        found[name] = one.replace(kind=KEYWORD, annotation=Annotated[one.annotation, Parameter(help=" ".join(said))])
    return found


def _check_options(call: Call, chosen: dict[str, ModuleType], parts: dict[str, ModuleType]) -> None:
    """Refuse options that no chosen part has."""
    taken = {one.name for module in chosen.values() for one in arguments(module)}
    for part, module in parts.items():
        for one in arguments(module):
            if one.name not in {*taken, COMMAND} and call.arguments[one.name] != one.default:
                option = f"--{one.name.replace('_', '-')}"
                raise BadInput(f"{option} is an option of {part}: leave it out, or choose this part")
