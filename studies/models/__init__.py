"""What answers problems: each kind of models is a class in a file of this package, and nothing lists it.

A new kind is a file with a class of `studies.mechanics.model.Model`. Its columns and statuses, JSON, headings,
titles and the help of `--models` follow.
"""

from __future__ import annotations

import functools
import inspect
import pkgutil
from collections.abc import Sequence
from importlib import import_module

from geometry.bad_input import closest
from geometry.design import BadInput
from studies.mechanics.model import Model


@functools.cache
def kinds() -> tuple[type[Model], ...]:
    """Return the kinds of models, in the order of their files."""
    files = [import_module(f"{__name__}.{file.name}") for file in pkgutil.iter_modules(__path__)]
    return tuple(
        each
        for file in files
        for each in vars(file).values()
        if inspect.isclass(each) and issubclass(each, Model) and each.__module__ == file.__name__
    )


def named(name: str) -> Model | None:
    """Return the model that a name means; None if there is none.

    >>> [named(name).name for name in ("fem", "fem:half-quick", "paper", "tolerance:1%")]
    ['standard', 'half-quick', 'paper', 'chosen']
    """
    return next((found for kind in kinds() if (found := kind.named(name))), None)


def models_of(given: Sequence[str | Model]) -> tuple[Model, ...]:
    """Return the models of a study, in the order of their columns; names as in `studies.cases.answer`."""
    models = [each if isinstance(each, Model) else _named(each) for each in given]
    names = [model.name for model in models]
    for each, model in zip(given, models, strict=True):
        if names.count(model.name) > 1:
            if all(isinstance(one, str) for one, name in zip(given, names, strict=True) if name == model.name):
                alike = [str(one) for one, name in zip(given, names, strict=True) if name == model.name]
                if len({*alike}) > 1:
                    raise BadInput(
                        f"models {' and '.join(alike)} have one name in tables, {model.name}: give one of them"
                    )
                raise BadInput(f"model {each} is given twice: give each model once")
            raise BadInput(f"two models have the name {model.name}: give one FemModel another name")
        model.check_beside([other for other in models if other is not model])
    return tuple(sorted(models, key=lambda model: (not model.states_errors, model.order)))


def _named(name: str) -> Model:
    found = named(name)
    if found is None:
        known = [each for kind in kinds() for each in kind.known or kind.names]
        close = closest(name, known)
        hint = f"did you mean {close}?" if close else f"choose from {', '.join(known)}"
        raise BadInput(f"there is no model {name!r}: {hint}")
    return found


def kind_of(name: str, prefix: str = "") -> type[Model]:
    """Return the kind of a model by its name and the first part of its columns, where that is known.

    >>> [kind_of(*each).head for each in (("rough", "fem_"), ("fem", ""), ("tip", ""), ("half-quick", ""))]
    ['fem', 'fem', 'analytic', 'fem']
    """
    by_head = [kind for kind in kinds() if kind.head and (prefix.startswith(f"{kind.head}_") or name == kind.head)]
    by_name = [kind for kind in kinds() if name in kind.names]
    return (by_head or by_name or [Model])[0]


def choice() -> str:
    """Return the models of all kinds, for help."""
    return "; ".join(f"{kind.words} ({', '.join(kind.known or kind.names)})" for kind in kinds())
