"""Parameters of several verbs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter

from geometry.design import Design
from geometry.loads import Magnet
from studies.inputs import input_warnings, user_input

Source = Annotated[str, Parameter(name="DESIGN", help="Name of a preset (paper) or path of a TOML file.")]
Sets = Annotated[
    list[str] | None, Parameter(name="--set", help="Override a field of the design, KEY=VALUE; repeatable.")
]
AsJson = Annotated[bool, Parameter(name="--json", help="Print JSON only, one object per line.")]
Wide = Annotated[
    bool,
    Parameter(name="--wide", help="Show all columns of a table; default: as many main columns as fit."),
]


def design_of(source: str, sets: Sequence[str] | None, magnet: Magnet = "rigid") -> Design:
    """Read a design and warn of fields without effect and of values that no silicone has."""
    design = user_input.read_design(source, sets or [], magnet=magnet)
    input_warnings.warn_of_values(design)
    return design
