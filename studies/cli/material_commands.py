"""The verb fit: a silicone's laws from a uniaxial test, its relaxation from a relaxation test or a dynamic test."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from studies.cli.parameters import AsJson, Wide, destination
from studies.inputs.input_warnings import say_no_effect
from studies.inputs.option_groups import LawName
from studies.output.result import publish

COLUMNS = (
    "CSV of a uniaxial test: stretch, strain or strain_percent; nominal_stress_MPa, nominal_stress_kPa or "
    "nominal_stress_Pa. Of a relaxation test: time_s (ms, min, h); nominal_stress_MPa with a held stretch, or "
    "youngs_modulus_MPa or shear_modulus_MPa; optionally stretch and ramp_s. Of a dynamic test: frequency_Hz; "
    "storage_modulus_MPa and loss_modulus_MPa (of Young's modulus; shear_... of the shear modulus) or tan_delta."
)
Data = Annotated[str, Parameter(name="FILE", help=COLUMNS)]


def fit(
    data: Data,
    /,
    *,
    law: LawName | None = None,
    stretch: float | None = None,
    ramp: float | None = None,
    out: Path | None = None,
    nu: float = 0.4998,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Fit a silicone's laws to a uniaxial test, or its relaxation to a relaxation test or a dynamic test.

    A uniaxial test gives E and the laws, ranked, with the stretches where each is stable; two or three values from a
    data sheet are enough for laws with as few constants. The other tests give Prony branches, their number chosen by
    AICc, and the times and frequencies for which they speak. The names of the columns decide which test it is.

    AICc weighs the error of a fit against its number of constants; less is better. Those within 2 of the least AICc
    count as equally good, and of them the one with the fewest constants or branches comes first or is chosen.

    Parameters
    ----------
    law
        Law for design.toml; default: the best one that fits the test and is stable in the test and in a press to
        3/8 D.
    stretch
        Held stretch of a relaxation test with a stress, if no column has it.
    ramp
        Time in which the stretch of a relaxation test rose from t = 0 on, s, if no column has it; the fit accounts
        for the ramp. 0 states that a ramp is negligible.
    out
        Folder for the table, the plot and design.toml with the chosen law or branches.
    nu
        Poisson's ratio for which E is given.
    """
    from studies.simulation import material_fit, relaxation_test

    here = destination(fit, locals(), material_fit.FILES, [data])
    kind = relaxation_test.kind_of(data)
    uses = (("--law", law, "uniaxial"), ("--stretch", stretch, "relaxation"), ("--ramp", ramp, "relaxation"))
    for option, value, fits in uses:
        if value is not None and kind != fits:
            say_no_effect(option, f"{data} is a {kind} test")
    if kind == "uniaxial":
        return publish(partial(material_fit.laws, data, nu, law, here.command, wide=wide), here)
    return publish(partial(material_fit.branches, data, nu, stretch, ramp, here.command, wide=wide), here)
