"""Targets of `verify` in time: viscoelastic cubes, beams and a half space."""

from __future__ import annotations

from studies.validation import dissipation_problems, time_problems
from studies.validation.verification_target import Quantity, Target, relative

LEVELS = ("quick", "standard", "fine")


def targets() -> list[Target]:
    """Return the targets in time."""
    cube = [
        relative(f"{name} after {t} s, over that of the modulus", value, 1e-9)
        for t in ("0", "0.3", "3")
        for name, value in (("sigma_xz/mu", 0.8), ("(sigma_xx - sigma_zz)/mu", 0.64))
    ]
    laws = ("linear overstresses", "law for large rates")
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
            tuple(Quantity(f"1 - difference / largest stress, {law}", 1.0, 1e-7) for law in laws),
        ),
        Target(
            "sign of the dissipation at a point",
            "second law; mesh numbers are time steps of a cycle",
            dissipation_problems.negative_dissipation,
            (
                *(Quantity(f"1 - negative / moved work of a closed cycle, {law}", 1.0, 1e-12) for law in laws),
                Quantity(f"1 - negative dissipation of a step / most work of a step, {laws[1]}", 1.0, 1e-3),
            ),
            meshes=(100,),
            quick=(100,),
            note="steps by linear overstresses may have a negative one: -0.05 in a fast shear of 0.5, -1.8 in a fast "
            "stretch to twice the length, since the energy that they store is that of small strain",
        ),
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
                for law in laws
            ),
            note="the plate's springs follow the modulus of the design, so they are scaled for the slow presses; "
            "with the usual ones, twice as stiff beside the relaxed silicone, the force is 1.5e-5 larger",
        ),
        Target(
            "energy of a sheared beam",
            "work = stored + dissipated; mesh numbers are time steps of a stroke",
            time_problems.balance,
            tuple(relative(f"(stored + dissipated) / work, {law}", 1.0, 1e-6) for law in laws),
            meshes=(24, 48, 96),
            quick=(),
            judged="extrapolated",
        ),
        *(
            Target(
                f"energy of {name}",
                "work = stored + dissipated + slip, and no step dissipates less than nothing; mesh numbers are time "
                "steps of a stroke",
                compute,
                tuple(
                    quantity
                    for law in laws
                    for quantity in (
                        Quantity(f"1 - largest error / largest work, {law}", 1.0, bound),
                        Quantity(f"1 - negative / all dissipation, {law}", 1.0, 1e-9),
                    )
                ),
                meshes=(steps,),
                quick=(),
                note=note,
            )
            for name, compute, steps, bound, note in (
                ("a press in contact", time_problems.touching, 384, 1e-6, ""),
                (
                    "a sliding plate",
                    time_problems.sliding,
                    96,
                    1e-5,
                    "points of the skin that begin to slip within a step leave more than those that touch",
                ),
            )
        ),
        Target(
            "order of the time steps",
            "theory: second order; mesh numbers are time steps of a stroke",
            time_problems.change,
            tuple(Quantity(f"order of the force, {law}", 2.0, 0.1) for law in laws),
            meshes=(24, 48),
            quick=(),
            judged="order",
        ),
    ]
