"""The studies of `magtip validate`, each with its page in a folder: do the answers hold, and what do they cost?"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import partial, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any

from studies import validation
from studies.cli.parameters import KEYWORD, POSITIONAL, Call, verb
from studies.output.result import publish

MODULES = {
    "accuracy": "accuracy_study",
    "range_": "design_range",
    "surrogate": "surrogate_study",
    "vibration": "vibration_check",
    "calibration": "calibration_check",
    "firmware": "firmware_check",
    "search": "random_sizing",
}
"""Modules of studies that have other names."""
INPUTS = ("store", "study", "states", "trained")
"""Options whose files no output may replace."""


def __getattr__(name: str) -> Callable[..., int]:
    """Return the verb of a module of `studies.validation`: its `run`, whose docstring is the help, with --out.

    Such a module has `FILES`, and options with defaults behind the progress of `run`, which may also take the
    `command` that makes the result again.
    """
    module = MODULES.get(name, name)
    if not (Path(validation.__file__).parent / f"{module}.py").exists():
        raise AttributeError(name)
    study = import_module(f"studies.validation.{module}")
    options = list(inspect.signature(study.run, eval_str=True).parameters.values())[1:]
    own = [
        one.replace(kind=POSITIONAL if one.name == "study" else KEYWORD) for one in options if one.name != "command"
    ]

    def run(call: Call, *words: Any, **given: Any) -> int:
        here = call.here(study.FILES, [call.arguments.get(key) for key in INPUTS])
        chosen = {one.name: call.arguments.get(one.name, here.command) for one in options}
        return publish(partial(study.run, **chosen), here)

    update_wrapper(run, study.run, ("__doc__",), ()).__name__ = name
    vars(run)["__signature__"] = inspect.Signature([inspect.Parameter("call", POSITIONAL), *own])
    return verb("wide as_json", out="Folder for the page, tables and pictures of the study.")(run)
