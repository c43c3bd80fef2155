"""Options of several verbs, and what they mean: the design, and where the result goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from geometry.design import Design
from geometry.loads import Magnet
from studies.cli.printed_command import command
from studies.inputs import input_warnings, user_input
from studies.inputs.option_groups import Whole
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
    input_warnings.warn_of_values(design)
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
