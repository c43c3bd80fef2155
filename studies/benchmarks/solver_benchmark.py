"""Speed: what the finite elements cost at a given error, beside FElupe and CalculiX, and how the cost grows.

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from fem.accuracy import STANDARD
from geometry.design import Design, paper
from geometry.messages import Progress
from studies.benchmarks import benchmark_tables, peers
from studies.benchmarks.benchmark_cases import (
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
from studies.benchmarks.benchmark_statistics import Answer, compared, exponents, measured, median
from studies.benchmarks.benchmark_tables import BenchRow
from studies.benchmarks.peer_calculix import Press

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
"""

LEAST, MORE_S, MODES_S, TIMES = 4.0, 0.2, 0.5, 10.0
"""Goals: peers' CPU seconds over magtip's; CPU seconds of a small shear beyond the press and of the modes; half over
harmonic model under shear."""

GROWTH = (0.2, 0.14, 0.105, 0.08)
GROWTH_FULL = (*GROWTH, 0.065, 0.053, 0.041)
"""Edge lengths of the half model for the cost against size, in units of D: 5k to 40k and to 300k unknowns; the larger
ones are run once."""


@dataclass(slots=True)
class _Bench:
    """State of a run of the benchmark: its options, its rows so far, and the chosen accuracy of each case."""

    quick: bool
    peers: Path
    ccx: str
    progress: Progress | None
    design: Design = field(default_factory=paper)
    rows: list[BenchRow] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    references: dict[str, list[Sequence[float]]] = field(default_factory=dict)
    chosen: dict[str, Answer] = field(default_factory=dict)
    done: float = 0.0

    @property
    def runs(self) -> int:
        return 3 if self.quick else 5

    def say(self, text: str) -> None:
        if self.progress is not None:
            self.progress(self.done, text)


def run(
    *,
    quick: bool = False,
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
    peers_folder : FElupe's environment.
    ccx : CalculiX.
    command : that this is run by.
    """
    bench = _Bench(quick, peers_folder, ccx, progress)
    about = benchmark_tables.machine()
    parts: list[tuple[float, Callable[[], None]]] = [(0.1, partial(_case, bench, case)) for case in CASES]
    parts[1:1] = [(0.1, partial(_felupe, bench))]
    parts[3:3] = [(0.2, partial(_calculix, bench))]
    parts += [(0.05, partial(_linear, bench)), (0.05, partial(_first_call, bench)), (0.15, partial(_growth, bench))]
    for share, part in parts:
        part()
        bench.done += share
        if folder is not None:
            benchmark_tables.write(folder, bench.rows, about | bench.versions, command, ABOUT)
    return bench.rows


def row(case: str, program: str, setting: str, answer: Answer | None = None, /, *, goal: str = "") -> BenchRow:
    """A row of the table from the answer of a process; what is not known is None."""
    answer = answer or {}
    forces = answer.get("forces_N")
    return BenchRow(
        case,
        program,
        setting,
        dofs=answer.get("dofs"),
        iterations=answer.get("iterations"),
        runs=answer.get("runs"),
        import_s=answer.get("import_s"),
        cpu_s=answer.get("cpu_s"),
        mesh_s=answer.get("mesh_s"),
        wall_s=answer.get("wall_s"),
        peak_MB=answer.get("peak_MB"),
        force_N=forces[-1] if forces else None,
        error_percent=answer.get("error_percent"),
        goal=goal,
        status=answer.get("status", "ok"),
        message=answer.get("message", ""),
    )


def spec(model: str, magnet: str, loads: Sequence[Fields], accuracy: Fields) -> Answer:
    """What `studies.benchmarks.benchmark_worker` is to solve."""
    return {"task": "trace", "model": model, "magnet": magnet, "loads": list(loads), "accuracy": accuracy}


def _case(bench: _Bench, case: Case) -> None:
    """magtip's row of one case, and its reference for the peers."""
    truth = None
    if case.reference is not None and (case.quick_reference or not bench.quick):
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
    setting = ", ".join(f"{name} {value:g}{'' if name == 'harmonics' else ' D'}" for name, value in rung.items())
    met = answer["status"] == "ok" and all(good for _, good in goals)
    faster = _over_half(bench, case, answer)
    if faster is not None:
        goals.append((f"{TIMES:g} times faster than the half model", faster >= TIMES))
        met = met and faster >= TIMES
    goal = ", ".join([text for text, _ in goals] + ([f"within {case.tolerance_percent:g} %"] if truth else []))
    bench.rows.append(replace(row(case.name, "magtip", setting, answer, goal=goal), met=met, faster=faster))


def _over_half(bench: _Bench, case: Case, answer: Answer) -> float | None:
    """How many times faster than the half model a section answers the same scene, if that one has been measured."""
    half = next((r for r in bench.rows if r.case == case.name and "solid_size" in r.setting), None)
    if half is None or half.cpu_s is None or half.status != "ok" or answer["status"] != "ok":
        return None
    return float(half.cpu_s / answer["cpu_s"])


def _felupe(bench: _Bench) -> None:
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
        beside = replace(beside, faster=faster, met=faster >= LEAST)
    bench.rows.append(beside)


def _calculix(bench: _Bench) -> None:
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


def _beside(bench: _Bench, peer: BenchRow) -> BenchRow:
    """The peer's row with how many times faster magtip is; the mesher's time counts on neither side."""
    own = next((r for r in bench.rows if r.case == peer.case and r.program == "magtip"), None)
    peer = replace(peer, goal=f"magtip at least {LEAST:g} times faster", met=None)
    if own is None or own.status != "ok" or peer.status != "ok":
        return peer
    if peer.cpu_s is None or own.cpu_s is None or own.mesh_s is None:
        return peer
    faster = peer.cpu_s / (own.cpu_s - own.mesh_s)
    return replace(peer, faster=faster, met=faster >= LEAST)


def _missing(bench: _Bench, case: str, program: str) -> None:
    message = f"{program} is not installed: {peers.INSTALL[program].format(peers=bench.peers)}"
    goal = f"magtip at least {LEAST:g} times faster"
    bench.rows.append(row(case, program, "", {"status": "not installed", "message": message}, goal=goal))


def _linear(bench: _Bench) -> None:
    """Small shear about a press, beside the press alone, and natural frequencies; all at level standard."""
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
    modes = _repeated(
        bench, "first eight modes, rigid magnet", f"level {STANDARD.name}", {"task": "modes", "count": 8}
    )
    met = bool(modes.get("cpu_s", math.inf) <= MODES_S)
    bench.rows[-1] = replace(bench.rows[-1], goal=f"at most {MODES_S:g} s", met=met)


def _repeated(bench: _Bench, case: str, setting: str, task: Answer) -> Answer:
    """The median of several runs, which is also a row."""
    bench.say(f"{case}: {setting}")
    answer = median([peers.magtip(task) for _ in range(bench.runs)])
    bench.rows.append(row(case, "magtip", setting, answer))
    return answer


def _first_call(bench: _Bench, least: float = 5.0) -> None:
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


def _growth(bench: _Bench) -> None:
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
