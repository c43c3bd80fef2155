"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and how the cost grows.

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import contextlib
import math
import statistics
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from fem.accuracy import STANDARD
from geometry.design import BadInput
from geometry.messages import Progress
from studies.validation import benchmark_tables, earlier_commit, peers
from studies.validation.benchmark_cases import (
    CASES,
    CCX_LADDERS,
    CURVE,
    DEPTH_MM,
    DEPTHS_MM,
    HALF,
    TRIANGLES,
    Case,
    Fields,
)
from studies.validation.benchmark_state import Bench, row, spec
from studies.validation.benchmark_statistics import (
    Answer,
    Forces,
    compared,
    exponents,
    matching_rungs,
    measured,
    median,
)
from studies.validation.benchmark_tables import BenchRow
from studies.validation.peer_calculix import Press
from studies.validation.speed_comparison import (
    beside_earlier,
    beside_floor,
    compiled_functions,
    field_points,
    measure_machine,
    section_meshes,
    small_shear_beyond,
    tilted_plate,
)

ABOUT = """\
Every solve runs in a separate process on one thread. Figures are medians of several runs: CPU seconds without
imports, and peak memory of the process and its children. The imports are timed separately (`import_s`). Each
program has a series of meshes. Of these, the cheapest counts whose force is within the tolerance at every load and
in every run, compared with a fine axisymmetric reference. The error is the largest over all loads. For a shear, the
reference is the harmonic model on a fine mesh, and the tilt must be within the tolerance as well.

The time of magtip includes its mesher; the other programs get a finished mesh from the same mesher. Meshing with
tetrahedra costs as much as the solve, so that the comparison with CalculiX leaves out the mesher's time (`mesh_s`).
`faster` is the CPU time of the other program over that of magtip. Solves longer than 20 s are measured once. The
speed of a machine changes within minutes. Therefore two programs that are compared run by turns if a solve takes
less than a second. The median over the turns counts: of the ratio for FElupe, and of the difference for a small
shear.

"Times as fast as commit f83a532" is the median of ratios of CPU seconds by turns: today's packages, and those of that
commit, unpacked from git. Both have the same mesh sizes; where the earlier commit is not within the tolerance on
them, it has the cheapest of the series on which it is in all turns. They run in new processes on one thread, after
the imports and after a small solve of another design, which loads the functions that numba has compiled. The wait for
compiling them once after an installation, and for loading them, has its own table; it counts as imports. The sample
of the section's meshes is that of `magtip validate range`, without impossible designs; the ratio is that of each
design.
"""

LEAST, MORE_S, MODES_S, TIMES = {"FElupe": 12.0, "CalculiX": 4.0}, 0.2, 0.5, 10.0
"""Goals: peers' CPU seconds over magtip's; CPU seconds of a small shear beyond the press and of the modes; half over
harmonic model under shear."""
SMALL_SHEAR_TIMES, MODES_TIMES = 3.0, 3.0
"""Goals: times as fast as the earlier commit."""

GROWTH = (0.2, 0.14, 0.105, 0.08)
GROWTH_FULL = (*GROWTH, 0.065, 0.053, 0.041)
"""Edge lengths of the half model for the cost against size, in units of D: 5k to 40k and to 300k unknowns; the larger
ones are run once."""


def run(
    *,
    quick: bool = False,
    cases: Sequence[str] = (),
    folder: Path | None = None,
    peers_folder: Path = Path("out/peers"),
    ccx: str = "ccx",
    command: str = "",
    progress: Progress | None = None,
) -> list[BenchRow]:
    """All rows; with a folder also bench.csv, BENCH.md and size.png in it, written anew after each case.

    Parameters
    ----------
    quick : medians of 3 instead of 5, up to 50k unknowns, CalculiX without the sensor's own Poisson's ratio.
    cases : names of the parts to run, see `names`; none for all.
    peers_folder : FElupe's environment.
    ccx : CalculiX.
    command : that this is run by.

    Raises
    ------
    BadInput
        A case has another name.
    """
    if unknown := [name for name in cases if name not in names()]:
        raise BadInput(f"--cases takes {', '.join(names())}; got {unknown[0]}")
    bench = Bench(quick, peers_folder, ccx, progress)
    about = benchmark_tables.machine()
    chosen = [part for part in _parts() if part[0] in cases or not cases]
    whole = sum(share for _, share, _ in chosen)
    with contextlib.ExitStack() as stack:
        try:
            earlier_commit.check_solver()
            bench.earlier = stack.enter_context(earlier_commit.unpacked(earlier_commit.COMMIT))
        except BadInput as error:
            about["comparison"] = str(error)
        measure_machine(bench)
        for _, share, part in chosen:
            part(bench)
            bench.done += share / whole
            if folder is not None:
                benchmark_tables.write(folder, bench.rows, about | bench.versions, command, ABOUT)
    return bench.rows


def names() -> list[str]:
    """Return the names of the parts of the bench."""
    return list(dict.fromkeys(name for name, _, _ in _parts()))


def _parts() -> list[tuple[str, float, Callable[[Bench], None]]]:
    """Return the parts of the bench: name, share of the time, function. A peer has the name of its case."""
    parts: list[tuple[str, float, Callable[[Bench], None]]] = [("compiled", 0.05, compiled_functions)]
    parts += [(case.key, 0.1, partial(_case, case=case)) for case in CASES]
    parts[2:2] = [("press-curve", 0.05, _felupe), ("section", 0.05, section_meshes)]
    parts[5:5] = [("half-press", 0.2, _calculix)]
    parts += [("tilted-plate", 0.05, tilted_plate), ("small-shear", 0.05, _small_shear), ("modes", 0.03, _modes)]
    return [*parts, ("field", 0.03, field_points), ("first-call", 0.02, _first_call), ("growth", 0.15, _growth)]


def _case(bench: Bench, case: Case) -> None:
    """magtip's row of one case, and its reference for the peers."""
    # two models of one scene share its reference
    truth = bench.references.get(case.name)
    if truth is None and case.reference is not None and (case.quick_reference or not bench.quick):
        bench.say(f"{case.name}: reference")
        model, accuracy = case.reference
        found = peers.magtip(spec(model, case.magnet, case.loads, accuracy))
        if found["status"] != "ok":
            lost = {"status": "no reference", "message": f"the reference failed: {found['message']}"}
            goal = f"within {case.tolerance_percent:g} %"
            bench.rows.append(replace(row(case.name, "magtip", "", lost, goal=goal), met=False))
            return
        truth = bench.references[case.name] = compared(found)
    bench.say(f"{case.name}: magtip")
    rung, answer = measured(
        lambda accuracy: peers.magtip(spec(case.model, case.magnet, case.loads, accuracy)),
        case.ladder,
        truth,
        case.tolerance_percent,
        bench.runs,
    )
    bench.chosen[case.name] = spec(case.model, case.magnet, case.loads, rung)
    limits = ((case.goal_s, "cpu_s", "s"), (case.goal_MB, "peak_MB", "MB"))
    goals = [(f"at most {limit:g} {unit}", answer.get(key, math.inf) <= limit) for limit, key, unit in limits]
    goals = [goal for goal, limit in zip(goals, limits, strict=True) if math.isfinite(limit[0])]
    met = answer["status"] == "ok" and all(good for _, good in goals)
    faster = _over_half(bench, case, answer)
    if faster is not None:
        goals.append((f"{TIMES:g} times faster than the half model", faster >= TIMES))
        met = met and faster >= TIMES
    goal = ", ".join([text for text, _ in goals] + ([f"within {case.tolerance_percent:g} %"] if truth else []))
    own = replace(row(case.name, "magtip", _setting(rung), answer, goal=goal), met=met, faster=faster)
    task = bench.chosen[case.name]
    bench.rows.append(beside_floor(bench, _beside_earlier_rung(bench, case, own, rung, truth), task))


def _setting(rung: Fields) -> str:
    return ", ".join(f"{name} {value:g}{'' if name == 'harmonics' else ' D'}" for name, value in rung.items())


def _beside_earlier_rung(bench: Bench, case: Case, own: BenchRow, rung: Fields, truth: Forces | None) -> BenchRow:
    """Return the row beside the earlier commit, and say on which mesh that is, if not on today's, `rung`.

    It is the same mesh if the earlier commit is within the tolerance on it, or if there is no tolerance; else its
    cheapest one on which it stays within the tolerance in all turns.
    """

    def task(fields: Fields) -> Answer:
        return spec(case.model, case.magnet, case.loads, fields)

    packages, rungs = bench.earlier, [rung]
    if packages is not None and own.status == "ok" and truth is not None and math.isfinite(case.tolerance_percent):
        bench.say(f"{case.name}: commit {earlier_commit.COMMIT}")
        solve = partial(peers.magtip, packages=packages)
        rungs = matching_rungs(lambda one: solve(task(one)), rung, case.ladder, truth, case.tolerance_percent)
    for earlier in rungs:
        message = "" if earlier == rung else f"commit {earlier_commit.COMMIT} needs {_setting(earlier)}"
        beside = replace(own, message=message)
        beside = beside_earlier(bench, beside, task(rung), truth, case.times, task(earlier))
        error = beside.earlier_error_percent
        if error is None or error <= case.tolerance_percent:
            return beside
    words = (
        f"commit {earlier_commit.COMMIT} has an error of {error:.2g} % on {_setting(earlier)}, beyond the tolerance"
    )
    return replace(beside, message=words)


def _over_half(bench: Bench, case: Case, answer: Answer) -> float | None:
    """How many times faster than the half model a section answers the same scene, if that one has been measured."""
    half = next((r for r in bench.rows if r.case == case.name and "solid_size" in r.setting), None)
    if half is None or half.cpu_s is None or half.status != "ok" or answer["status"] != "ok":
        return None
    return float(half.cpu_s / answer["cpu_s"])


def _felupe(bench: Bench) -> None:
    """FElupe's row of the press curve."""
    python = peers.felupe_python(bench.peers)
    if python is None:
        _missing(bench, CURVE, "FElupe")
        return
    bench.say(f"{CURVE}: FElupe")
    (size, tip), answer = measured(
        lambda rung: peers.felupe(python, bench.design, DEPTHS_MM, *rung),
        TRIANGLES,
        bench.references.get(CURVE),
        0.5,
        bench.runs,
    )
    bench.versions["FElupe"] = answer.get("version", "")
    setting = f"second-order triangles (u, p, J), size {size:g} D, tip x {tip:g}"
    beside = _beside(bench, row(CURVE, "FElupe", setting, answer))
    if beside.met is not None:
        bench.say(f"{CURVE}: magtip and FElupe by turns")
        ratios = []
        for _ in range(bench.runs):
            own, peer = peers.magtip(bench.chosen[CURVE]), peers.felupe(python, bench.design, DEPTHS_MM, size, tip)
            # a run that fails counts as the slowest
            ratios.append(peer.get("cpu_s", 0.0) / own.get("cpu_s", math.inf))
        faster = statistics.median(ratios)
        beside = replace(beside, faster=faster, met=faster >= LEAST["FElupe"])
    bench.rows.append(beside)


def _calculix(bench: Bench) -> None:
    """CalculiX' rows of the half model's press, one for each Poisson's ratio."""
    version = peers.have_calculix(bench.ccx)
    if version is None:
        _missing(bench, HALF, "CalculiX")
        return
    bench.versions["CalculiX"] = f"ccx {version}"
    design = bench.design
    press = Press(design.E, design.nu, design.L, design.R, DEPTH_MM)
    meshes = {size: peers.half_mesh(design, size) for size in sorted({s for v in CCX_LADDERS.values() for s in v})}
    for nu, ladder in CCX_LADDERS.items():
        setting = f"C3D10, nu {nu:g}"
        if bench.quick and nu == design.nu:
            left_out = {"status": "left out", "message": "not part of the quick run"}
            bench.rows.append(row(HALF, "CalculiX", setting, left_out))
            continue
        bench.say(f"{HALF}: CalculiX with nu {nu:g}")
        given = replace(press, nu=nu)
        if nu == design.nu:
            given = replace(given, contact="NODE TO SURFACE", stiffness=100.0)
        size, answer = measured(
            partial(_press_by_calculix, bench.ccx, meshes, given),
            ladder,
            bench.references.get(HALF),
            1.0,
            bench.runs,
        )
        bench.rows.append(_beside(bench, row(HALF, "CalculiX", f"{setting}, size {size:g} D", answer)))


def _press_by_calculix(ccx: str, meshes: dict[float, Any], press: Press, size: float) -> Answer:
    return peers.calculix(ccx, meshes[size], press)


def _beside(bench: Bench, peer: BenchRow) -> BenchRow:
    """The peer's row with how many times faster magtip is; the mesher's time counts on neither side."""
    own = next((r for r in bench.rows if r.case == peer.case and r.program == "magtip"), None)
    peer = replace(peer, goal=f"magtip at least {LEAST[peer.program]:g} times faster", met=None)
    if own is None or own.status != "ok" or peer.status != "ok":
        return peer
    if peer.cpu_s is None or own.cpu_s is None or own.mesh_s is None:
        return peer
    faster = peer.cpu_s / (own.cpu_s - own.mesh_s)
    return replace(peer, faster=faster, met=faster >= LEAST[peer.program])


def _missing(bench: Bench, case: str, program: str) -> None:
    message = f"{program} is not installed: {peers.INSTALL[program].format(peers=bench.peers)}"
    goal = f"magtip at least {LEAST[program]:g} times faster"
    bench.rows.append(row(case, program, "", {"status": "not installed", "message": message}, goal=goal))


def _small_shear(bench: Bench) -> None:
    """Small shear about a press, beside the press alone, at level standard."""
    press = spec("axisymmetric", "rigid", ({"depth": DEPTH_MM},), {})
    shear, case = {"task": "small shear", "depth": DEPTH_MM}, "small shear about a press of 1 mm"
    bench.say(case)
    turns = [(peers.magtip(press), peers.magtip(shear)) for _ in range(bench.runs)]
    for setting, answers in zip(
        ("the press alone", "with stiffness and tilt"), zip(*turns, strict=True), strict=True
    ):
        bench.rows.append(row(case, "magtip", setting, median(answers)))
    more = statistics.median(b.get("cpu_s", math.inf) - a.get("cpu_s", 0.0) for a, b in turns)
    bench.rows[-1] = replace(bench.rows[-1], goal=f"at most {MORE_S:g} s more", met=more <= MORE_S)
    whole = bench.rows[-1] = beside_floor(bench, bench.rows[-1], shear)
    if bench.earlier is not None:
        bench.rows.append(small_shear_beyond(bench, whole, press, shear, SMALL_SHEAR_TIMES))


def _modes(bench: Bench) -> None:
    """Natural frequencies at level standard."""
    task = {"task": "modes", "count": 8}
    modes = _repeated(bench, "first eight modes, rigid magnet", f"level {STANDARD.name}", task)
    met = bool(modes.get("cpu_s", math.inf) <= MODES_S)
    own = replace(bench.rows[-1], goal=f"at most {MODES_S:g} s", met=met)
    bench.rows[-1] = beside_floor(bench, beside_earlier(bench, own, task, None, MODES_TIMES), task)


def _repeated(bench: Bench, case: str, setting: str, task: Answer) -> Answer:
    """The median of several runs, which is also a row."""
    bench.say(f"{case}: {setting}")
    answer = median([peers.magtip(task) for _ in range(bench.runs)])
    bench.rows.append(row(case, "magtip", setting, answer))
    return answer


def _first_call(bench: Bench, least: float = 5.0) -> None:
    """The first command after an installation, when Python has compiled nothing yet, and the second."""
    case, waits = "first call of solve, press 1 mm", []
    with tempfile.TemporaryDirectory() as cache:
        for name in ("no bytecode yet", "again"):
            bench.say(f"{case}: {name}")
            command = ["solve", "paper", "--depth", "1", "--json"]
            env = {"PYTHONPYCACHEPREFIX": cache, "PYTHONDONTWRITEBYTECODE": ""}
            answer = peers.magtip({"task": "first", "command": command}, env=env)
            waits.append(answer.get("wall_s", math.nan))
            bench.rows.append(row(case, "magtip", name, answer | {"runs": 1}))
    goal = f"first call at most {least:g} s longer"
    bench.rows[-2] = replace(bench.rows[-2], goal=goal, met=waits[0] - waits[1] <= least)


def _growth(bench: Bench) -> None:
    """Time and memory of the half model's press against its size, with fitted exponents."""
    case, found = "cost against size, half model, press 0.25 mm", []
    for size in GROWTH if bench.quick else GROWTH_FULL:
        bench.say(f"{case}: {size:g} D")
        given = spec("half", "ignored", ({"depth": 0.25},), {"solid_size": size})
        _, answer = measured(peers.magtip, (given,), None, math.inf, bench.runs if size in GROWTH else 1)
        bench.rows.append(row(case, "magtip", f"solid_size {size:g} D", answer))
        if answer["status"] == "ok":
            found.append(answer)
    if len(found) > 1:
        fits = exponents(found).items()
        bench.rows += [
            BenchRow(case, "magtip", f"fit of {name}: {a:.2g} n^{p:.2f}", exponent=p) for name, (a, p) in fits
        ]
