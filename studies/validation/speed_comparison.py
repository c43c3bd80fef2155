"""Rows of the bench beside the earlier commit, by turns, and beside the floor of their linear algebra."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

from fem.accuracy import STANDARD
from studies.validation import peers
from studies.validation.benchmark_state import Bench, row
from studies.validation.benchmark_statistics import Answer, Forces, compared, errors_percent, median
from studies.validation.benchmark_tables import BenchRow
from studies.validation.earlier_commit import COMMIT

SHORT_S, LONG_S = 1.0, 5.0
"""CPU seconds below which tasks have more turns than the bench's other runs, and beyond which a tilted plate has
one."""
SHORT_TURNS = 9

SECTION_TIMES, FIELD_TIMES, SECOND_THREAD, TILTED = 10.0, 4.0, 1.6, 3.0
"""Goals: section mesh, times as fast as the earlier commit; field, times as fast as magpylib; the same with a second
thread, times as fast by the clock; tilted plate, CPU seconds over those of a shear."""
SECTIONS = 24
"""Number of designs of the range whose sections are meshed."""
POINTS = 1_000_000
TILT_DEG, TILTED_DEPTH_MM, SHEAR_MM = 8.0, 0.8, 1.0


def beside_earlier(
    bench: Bench, own: BenchRow, task: Answer, truth: Forces | None, least: float, earlier: Answer | None = None
) -> BenchRow:
    """Return a row with the time and error of the earlier commit for the same scene, measured by turns.

    Parameters
    ----------
    least : how many times as fast it should be: a goal more of the row; 0 for no goal.
    earlier : what the earlier commit solves, if not `task` as well.
    """
    if bench.earlier is None or own.status != "ok" or own.cpu_s is None:
        return own
    earlier = task if earlier is None else earlier
    bench.say(f"{own.case}: commit {COMMIT} by turns")
    count = SHORT_TURNS if own.cpu_s < SHORT_S and not bench.quick else bench.runs
    turns = [(peers.magtip(task), peers.magtip(earlier, packages=bench.earlier)) for _ in range(count)]
    failed = next((then for _, then in turns if then["status"] != "ok"), None)
    if failed is not None:
        return replace(own, message=f"commit {COMMIT}: {failed['message']}")
    times = statistics.median(then["cpu_s"] / now.get("cpu_s", math.inf) for now, then in turns)
    error = None
    if truth is not None:
        error = max(errors_percent(compared(then), truth) for _, then in turns)
    own = replace(
        own,
        earlier_s=statistics.median(then["cpu_s"] for _, then in turns),
        earlier_error_percent=error,
        times_as_fast=times,
    )
    return with_goal(own, least) if least else own


def small_shear_beyond(bench: Bench, own: BenchRow, press: Answer, shear: Answer, least: float) -> BenchRow:
    """Return the row of a small shear about a press with what it takes beyond the press beside the earlier commit."""
    if bench.earlier is None or own.status != "ok":
        return own
    bench.say(f"{own.case}: commit {COMMIT} by turns")
    turns = []
    for _ in range(bench.runs if bench.quick else SHORT_TURNS):
        now = [peers.magtip(task).get("cpu_s", math.inf) for task in (press, shear)]
        then = [peers.magtip(task, packages=bench.earlier).get("cpu_s", 0.0) for task in (press, shear)]
        turns.append((now[1] - now[0], then[1] - then[0]))
    now_s, earlier_s = (statistics.median(values) for values in zip(*turns, strict=True))
    # a difference of two short times may come out as 0 or less by chance: the ratio is that of the medians
    times = earlier_s / now_s if now_s > 0 else math.inf
    answer = {"cpu_s": now_s, "runs": len(turns)}
    alone = replace(row(own.case, "magtip", "stiffness and tilt alone", answer), earlier_s=earlier_s)
    return with_goal(replace(alone, times_as_fast=times), least)


def with_goal(own: BenchRow, least: float) -> BenchRow:
    """Return a row with one goal more: how many times as fast as the earlier commit."""
    if own.times_as_fast is None:
        return own
    goal = ", ".join(filter(None, (own.goal, f"{least:g} times as fast as commit {COMMIT}")))
    return replace(own, goal=goal, met=own.met is not False and own.times_as_fast >= least)


def beside_floor(bench: Bench, own: BenchRow, task: Answer) -> BenchRow:
    """Return a row with the time that its factorisations and assemblies need at least on this machine."""
    if own.status != "ok" or own.cpu_s is None or not bench.flops_per_s:
        return own
    counts = peers.magtip({**task, "operations": True})
    if counts["status"] != "ok":
        return own
    parts = ("factor", "assembly")
    floor = sum(
        max(counts[f"{part}_flops"] / bench.flops_per_s, counts[f"{part}_bytes"] / bench.bytes_per_s)
        for part in parts
    )
    return _with_floor(own, floor)


def _with_floor(own: BenchRow, floor: float) -> BenchRow:
    return replace(own, floor_s=floor, times_floor=own.cpu_s / floor if own.cpu_s and floor else None)


def measure_machine(bench: Bench) -> None:
    """Measure the machine's rates on one thread; they are listed with the versions."""
    bench.say("the machine's rates")
    answer = peers.magtip({"task": "machine"})
    if "flops_per_s" in answer:
        bench.flops_per_s, bench.bytes_per_s = answer["flops_per_s"], answer["bytes_per_s"]
        bench.versions["products of matrices, one thread"] = f"{bench.flops_per_s / 1e9:.1f} Gflop/s"
        bench.versions["sums of arrays, one thread"] = f"{bench.bytes_per_s / 1e9:.1f} GB/s"


def section_meshes(bench: Bench) -> None:
    """Rows of the section's mesh: the paper's design, and the median and the worst of a sample of the range."""
    case = "section mesh"
    sample = _sample(6 if bench.quick else SECTIONS)
    designs = [{}, *sample]
    task = {"task": "section", "size": STANDARD.section_size, "designs": designs}
    bench.say(case)
    turns = [
        (peers.magtip(task), peers.magtip(task, packages=bench.earlier) if bench.earlier else None)
        for _ in range(bench.runs)
    ]
    own = median([now for now, _ in turns])
    if own["status"] != "ok":
        bench.rows.append(row(case, "magtip", "", own))
        return
    each = [_median([now["each_s"][k] for now, _ in turns]) for k in range(len(designs))]
    earlier = [_median([then["each_s"][k] for _, then in turns if then]) for k in range(len(each))]
    ratios = [
        _median([then["each_s"][k] / now["each_s"][k] for now, then in turns if then and _both(now, then, k)])
        for k in range(len(each))
    ]
    meshed = [k for k in range(1, len(each)) if each[k] and ratios[k]] or [k for k in range(1, len(each)) if each[k]]
    order = sorted(meshed, key=lambda k: ratios[k] or 0.0)
    places = {"the paper's design": 0, f"median of {len(meshed)} designs": order[len(order) // 2]}
    places[f"worst of {len(meshed)} designs"] = order[0]
    for setting, k in places.items():
        answer = {"status": "ok", "cpu_s": each[k], "runs": bench.runs, "import_s": own["import_s"]}
        line = replace(row(case, "magtip", setting, answer), earlier_s=earlier[k], times_as_fast=ratios[k])
        bench.rows.append(with_goal(line, SECTION_TIMES))


def _both(now: Answer, then: Answer, k: int) -> bool:
    return bool(now["each_s"][k] and then["each_s"][k])


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None


def _sample(count: int) -> list[dict[str, float]]:
    """Return fields of possible designs, sampled over the whole range."""
    from dataclasses import asdict

    from geometry.design import BadInput, Design
    from studies.validation.design_range import samples

    chosen: list[dict[str, float]] = []
    for sample in samples(8 * count):
        fields = asdict(sample)
        try:
            Design(**fields)
        except BadInput:
            continue
        chosen.append(fields)
    return chosen[:count]


def field_points(bench: Bench) -> None:
    """Rows of the magnet's field: one thread beside the earlier commit and magpylib by turns, and two threads."""
    case = f"field of {'a million' if not bench.quick else '100 000'} points"
    count = POINTS // 10 if bench.quick else POINTS
    task = {"task": "field", "points": count}
    bench.say(case)
    two = {"OMP_NUM_THREADS": "2", "NUMBA_NUM_THREADS": "2"}
    one = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    turns = [
        (peers.magtip(task, env=one), peers.magtip(task, env=two), peers.magtip({**task, "task": "magpylib"}))
        for _ in range(bench.runs)
    ]
    single, double, other = (median(answers) for answers in zip(*turns, strict=True))
    own = beside_earlier(bench, row(case, "magtip", "one thread", single), task, None, 0.0)
    if bench.bytes_per_s and own.status == "ok":
        own = _with_floor(own, 2 * 24 * count / bench.bytes_per_s)
    bench.rows.append(own)
    second = row(case, "magtip", "two threads", double, goal=f"{SECOND_THREAD:g} times as fast by the clock as one")
    if single["status"] == double["status"] == "ok":
        gain = statistics.median(a["wall_s"] / b["wall_s"] for a, b, _ in turns)
        message = f"{gain:.2f} times as fast by the clock as one thread"
        second = replace(second, met=gain >= SECOND_THREAD, message=message)
    bench.rows.append(second)
    goal = f"magtip at least {FIELD_TIMES:g} times faster"
    if other["status"] != "ok":
        missing = {"status": "not installed", "message": "magpylib does not run: pip install 'magpylib>=5.1'"}
        bench.rows.append(row(case, "magpylib", "", missing, goal=goal))
        return
    bench.versions["magpylib"] = other["version"]
    faster = statistics.median(b["cpu_s"] / a["cpu_s"] for a, _, b in turns) if single["status"] == "ok" else None
    line = replace(row(case, "magpylib", "one thread", other, goal=goal), faster=faster)
    bench.rows.append(replace(line, met=faster is not None and faster >= FIELD_TIMES))


def tilted_plate(bench: Bench) -> None:
    """Rows of a tilted plate beside a shear, by turns, both at level standard and with the model of `auto`."""
    case = f"plate tilted by {TILT_DEG:g} deg, press {TILTED_DEPTH_MM:g} mm"
    tilt: Answer = {"depth": TILTED_DEPTH_MM, "plate_tilt": math.radians(TILT_DEG)}
    shear: Answer = {"depth": TILTED_DEPTH_MM, "shear_x": SHEAR_MM, "friction": "stick"}
    tasks = [
        {"task": "trace", "model": "auto", "magnet": "rigid", "loads": [load], "accuracy": {}}
        for load in (shear, tilt)
    ]
    bench.say(case)
    turns = [[peers.magtip(task) for task in tasks]]
    if all(answer.get("cpu_s", math.inf) < LONG_S for answer in turns[0]):
        turns = [[peers.magtip(task) for task in tasks] for _ in range(bench.runs)]
    sheared, tilted = (median(answers) for answers in zip(*turns, strict=True))
    bench.rows.append(row(case, "magtip", f"the same press with a shear of {SHEAR_MM:g} mm instead", sheared))
    line = row(
        case, "magtip", "tilted, level standard", tilted, goal=f"at most {TILTED:g} times the CPU s of the shear"
    )
    if sheared["status"] == tilted["status"] == "ok":
        times = statistics.median(b["cpu_s"] / a["cpu_s"] for a, b in turns)
        line = replace(line, met=times <= TILTED, message=f"{times:.2f} times the CPU s of the shear")
    bench.rows.append(beside_floor(bench, line, tasks[1]) if line.met else line)


def compiled_functions(bench: Bench) -> None:
    """Rows of the wait for functions that numba compiles: once after an installation, and in each later process."""
    import tempfile

    case = "functions compiled by numba"
    with tempfile.TemporaryDirectory() as cache:
        for setting in ("compiled after an installation", "loaded by a later process"):
            bench.say(f"{case}: {setting}")
            answer = peers.magtip({"task": "compiled functions"}, env={"NUMBA_CACHE_DIR": cache})
            if answer["status"] == "ok" and not answer["compiled"]:
                answer = {"status": "not installed", "message": "numba is not installed: install the extra `fast`"}
            bench.rows.append(row(case, "magtip", setting, answer | {"runs": 1}))
