"""Warnings of input that has no effect, or that is no silicone's."""

from __future__ import annotations

from geometry.design import Design, no_effect
from studies.output import console


def say_what_is_idle(design: Design) -> None:
    """A warning for each field that is set in vain, and where E is no silicone's."""
    for doubt in design.value_warnings():
        console.warn(doubt)


def say_no_effect(what: str, reason: str) -> None:
    """A warning for an option or an axis that another one, or the design, makes useless."""
    console.warn(no_effect([what], reason))
