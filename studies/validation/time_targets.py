"""Targets of `verify` in time: viscoelastic cubes, beams and a half space."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from studies.validation import dissipation_problems, time_problems
from studies.validation.verification_target import Quantity, Target, relative

LEVELS = ("quick", "standard", "fine")
LAWS = ("linear overstresses", "law for large rates")


def targets() -> list[Target]:
    """Return the targets in time."""
    return [*_points(), *_limits(), *_time_steps()]


def _points() -> list[Target]:
    """Return the targets of the laws at one point of the material."""
    cube = [
        relative(f"{name} after {t} s, over that of the modulus", value, 1e-9)
        for t in ("0", "0.3", "3")
        for name, value in (("sigma_xz/mu", 0.8), ("(sigma_xx - sigma_zz)/mu", 0.64))
    ]
    return [
        Target("relaxation of a sheared cube", "closed form", time_problems.relaxing_cube, tuple(cube)),
        Target(
            "cyclic shear of a cube",
            "closed form; mesh numbers are time steps of a cycle",
            time_problems.cyclic_cube,
            tuple(relative(f"{name} modulus / exact", 1.0, 1e-4) for name in ("storage", "loss")),
            meshes=(16, 32, 64),
            quick=(16, 32, 64),
            judged="extrapolated",
        ),
        Target(
            "cyclic stretch of a rubber block",
            "Holzapfel 1996; Ansys VM234; mesh numbers are time steps of a cycle",
            time_problems.holzapfel_block,
            (relative("Cauchy stress at 16 s, Pa", 6.013e5, 3e-3), relative("share relaxed at 20 s", 1.0, 1e-3)),
            meshes=(50, 100, 200),
            quick=(100,),
            note="the constants of the Ogden law are not printed in the manual; those used are the usual ones of "
            "Ogden 1972, 6.3e5, 1.2e3 and -1e4 Pa with 1.3, 5 and -2",
        ),
        Target(
            "frame invariance of a cube",
            "a superposed rotation turns the stress and changes nothing else",
            time_problems.turned_cube,
            tuple(Quantity(f"1 - difference / largest stress, {law}", 1.0, 1e-7) for law in LAWS),
        ),
        Target(
            "sign of the dissipation at a point",
            "second law; mesh numbers are time steps of a cycle",
            dissipation_problems.negative_dissipation,
            (
                *(Quantity(f"1 - negative / moved work of a closed cycle, {law}", 1.0, 1e-12) for law in LAWS),
                Quantity(f"1 - negative dissipation of a step / most work of a step, {LAWS[1]}", 1.0, 1e-3),
            ),
            meshes=(100,),
            quick=(100,),
            note="steps by linear overstresses may have a negative one: -0.05 in a fast shear of 0.5, -1.8 in a fast "
            "stretch to twice the length, since the energy that they store is that of small strain",
        ),
    ]


def _limits() -> list[Target]:
    """Return the targets of bodies whose forces follow from elastic ones."""
    return [
        Target(
            "held silicone beam",
            "exact for nu = 0.5: F(t)/F(0) = G(t)/G(0)",
            time_problems.held_beam,
            tuple(relative(f"F(t)/F(0) over G(t)/G(0) at {t} s", 1.0, 1e-6) for t in (0.3, 2)),
        ),
        Target(
            "viscoelastic half space",
            "Lee and Radok 1960, Ting 1966; mesh 2 is level standard",
            lambda n: time_problems.indented_half_space(LEVELS[n - 1]),
            tuple(relative(f"force / closed form, {t}", 1.0, 4e-3) for t in ("0.5 s", "1 s", "1.1 s (release)")),
            meshes=(2,),
            quick=(2,),
        ),
        Target(
            "fast and slow presses of the sensor",
            "elastic solves with the instantaneous and the long-term modulus",
            time_problems.limits,
            tuple(
                relative(f"force / elastic force, {speed}, {law}", 1.0, 1e-6)
                for speed in ("fast", "slow")
                for law in LAWS
            ),
            note="the plate's springs follow the modulus of the design, so they are scaled for the slow presses; "
            "with the usual ones, twice as stiff beside the relaxed silicone, the force is 1.5e-5 larger",
        ),
    ]


def _time_steps() -> list[Target]:
    """Return the targets of the time steps: the energy balance, and their order."""
    return [
        Target(
            "energy of a sheared beam",
            "work = stored + dissipated; mesh numbers are time steps of a stroke",
            time_problems.balance,
            tuple(relative(f"(stored + dissipated) / work, {law}", 1.0, 1e-6) for law in LAWS),
            meshes=(24, 48, 96),
            quick=(),
            judged="extrapolated",
        ),
        _energy_in_contact("a press in contact", time_problems.touching, 384, ""),
        _energy_in_contact(
            "a glued plate",
            lambda n: time_problems.touching(n, "stick"),
            72,
            "the error is that of a cycle after the press",
        ),
        _energy_in_contact(
            "a sliding plate",
            lambda n: time_problems.touching(n, 0.3),
            144,
            "the error is that of a cycle after the press: 7e-6 with 48 time steps, 2e-6 with 96",
        ),
        Target(
            "order of the time steps",
            "theory: second order; mesh numbers are time steps of a stroke",
            time_problems.change,
            tuple(Quantity(f"order of the force, {law}", 2.0, 0.1) for law in LAWS),
            meshes=(24, 48),
            quick=(),
            judged="order",
        ),
    ]


def _energy_in_contact(name: str, solve: Callable[[int], Sequence[float]], steps: int, note: str) -> Target:
    """Return the energy balance of a motion in contact with the sign of its dissipation."""
    balances = [
        (
            Quantity(f"1 - largest error / largest work, {law}", 1.0, 1e-6),
            Quantity(f"1 - negative / all dissipation, {law}", 1.0, 1e-9),
        )
        for law in LAWS
    ]
    return Target(
        f"energy of {name}",
        "work = stored + dissipated + slip, and no step dissipates less than nothing; mesh numbers are time steps "
        "of a stroke",
        solve,
        tuple(quantity for both in balances for quantity in both),
        meshes=(steps,),
        quick=(),
        note=note,
    )
