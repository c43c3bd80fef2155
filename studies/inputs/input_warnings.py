"""Warnings of input that has no effect, or of values that no silicone has."""

from __future__ import annotations

from geometry.bad_input import no_effect
from geometry.design import Design
from studies.output import console


def warn_of_values(design: Design) -> None:
    """Warn of each field that is set without effect, and of a value that no silicone has."""
    for warning in design.value_warnings():
        console.warn(warning)


def say_no_effect(what: str, reason: str) -> None:
    """Warn of an option or an axis that has no effect beside other options or with this design."""
    console.warn(no_effect([what], reason))
