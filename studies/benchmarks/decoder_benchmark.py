"""The decoder: round trips, second poses against an exhaustive search, speed, the paper's table, and ignored tilt.

`python -m studies.benchmarks.decoder_benchmark results/decode [FULL.npy]` writes DECODE.md; it needs numba. If
states.jsonl is in the folder, states of `magtip solve --json`, their tilt and load are decoded with as well. FULL.npy
is the paper's table as `magtip table paper --step 0.01 --out FULL.npy` writes it; without it its figures are
extrapolated.

ABOUT, which the report prints, describes the measurements.
"""

from __future__ import annotations

import contextlib
import dataclasses
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from analytic import beam, decode, magnet, stream
from analytic.decode import Decoder
from analytic.inverse import damped_newton, forward_model, response_surface
from geometry import compiled
from geometry.arrays import Array
from geometry.design import Design, paper
from studies.benchmarks import benchmark_tables, decoder_report, lookup_benchmark
from studies.benchmarks.decoder_report import DecoderSpeed, Measurements, RoundTrips, SecondPoses, TiltErrors
from studies.output import atomic_files, console
from studies.sensing import decode_readings

ABOUT = """\
Poses are drawn uniformly from the workspace: 3/8 D to each side and 3/8 D down. The elements have no limits of
their output here, so that any ambiguity comes from the layout. tau is the tilt per mm of the magnet's shift. A pose
is lost if no decoded pose lies within 1e-5 mm of it. "Other sign of det" is the share of poses at which the
determinant of the Jacobian has another sign than at rest; a test of the determinant alone would call these poses
ambiguous. The exhaustive search starts Newton's method from 13 x 13 x 7 poses for each set of readings.

Speeds are CPU time on one thread, the median of several runs; that of a stream is wall time. A reading of the
paper's table returns the entry with the nearest readings: in memory by a search tree, from the file of the full
table by bounds of its blocks (`analytic.lookup.nearest`).
"""


LAYOUTS = {
    "paper (h 2, l0 7.2, c 2)": {},
    "h 4, l0 8, c 2": {"magnet_height": 4.0, "l0": 8.0},
    "h 4, l0 6, c 2.5": {"magnet_height": 4.0, "l0": 6.0, "c": 2.5},
    "h 4, l0 6, c 4": {"magnet_height": 4.0, "l0": 6.0, "c": 4.0},
    "3-axis chip": {"hall_layout": "tmag5273a1"},
}
TAUS = (0.0, 0.2)
"""rad/mm: without tilt, and as finite elements have it (0.0844 rad and 0.406 mm per mm of shear at depth 1 mm)."""
WIDE = {"hall_low": 0.0, "hall_null": 50.0, "hall_high": 100.0}


def coder_of(design: Design, tau: float) -> Decoder:
    """With the paper's forces and a tilt of tau rad/mm, over the box."""
    law = response_surface.of_formula(lambda load: beam.solve(design, load), design.R, 5.0)
    law = dataclasses.replace(law, tau=np.array([[tau]]))
    elements = [dataclasses.replace(e, low=-100.0, high=100.0) for e in forward_model.model(design).elements]
    return decode.decoder(design, law, elements=elements, workspace=response_surface.workspace(design))


def poses(coder: Decoder, count: int, seed: int = 1) -> tuple[Array, Array]:
    """Shifts (3, n), mm, and what is read there, shape (k, n), T."""
    shift = np.random.default_rng(seed).uniform(coder.low, coder.high, (count, 3)).T.copy()
    return shift, forward_model.readings_at(coder.forward, shift)


def round_trips(count: int = 4000) -> list[RoundTrips]:
    """How well poses come back, and how many share their readings with others."""
    trips = []
    for name, fields in LAYOUTS.items():
        for tau in TAUS:
            coder = coder_of(Design(**fields), tau)  # type: ignore[arg-type]
            shift, field = poses(coder, count)
            found = decode.decode(coder, field.T)
            nearest = np.full(count, np.inf)
            np.minimum.at(nearest, found.owner, np.abs(found.poses - shift.T[found.owner]).max(axis=1))
            unique = found.multiplicity == 1
            det = np.linalg.det(np.moveaxis(forward_model.readings_with_slopes(coder.forward, shift)[1], 2, 0))
            rest = np.linalg.det(forward_model.readings_with_slopes(coder.forward, np.zeros((3, 1)))[1][:, :, 0])
            trips.append(
                RoundTrips(
                    layout=name,
                    tau=tau,
                    unique=unique.mean(),
                    error_mm=np.abs(found.shift - shift.T)[unique & (nearest < 1e-5)].max(),
                    lost=(nearest > 1e-5).mean(),
                    ambiguous=(found.multiplicity > 1).mean(),
                    other_sign=(det * rest < 0).mean(),
                    condition=np.nanmedian(found.condition[unique]),
                    worst_condition=np.nanmax(found.condition[unique]),
                )
            )
    return trips


def searches(count: int = 30) -> list[SecondPoses]:
    """Second poses beside those of an exhaustive search."""
    comparisons = []
    for name, fields in LAYOUTS.items():
        if "l0 6" not in name:
            continue
        for tau in TAUS:
            coder = coder_of(Design(**fields), tau)  # type: ignore[arg-type]
            _, field = poses(coder, count, seed=2)
            found = decode.decode(coder, field.T)
            every = [exhaustive(coder, field[:, k]) for k in range(count)]
            own = [found.poses[found.owner == k] for k in range(count)]
            several = [len(e) > 1 for e in every]
            missed = sum(not _among(p, mine) for e, mine in zip(every, own, strict=True) for p in e)
            only = sum(not _among(p, e) for e, mine in zip(every, own, strict=True) for p in mine)
            said = sum(len(mine) > 1 for mine, s in zip(own, several, strict=True) if s)
            comparisons.append(
                SecondPoses(
                    layout=name,
                    tau=tau,
                    readings=count,
                    ambiguous=sum(several),
                    said=said,
                    poses=sum(map(len, every)),
                    missed=missed,
                    only=only,
                )
            )
    return comparisons


def exhaustive(coder: Decoder, field: Array, counts: tuple[int, int, int] = (13, 13, 7)) -> Array:
    """All poses of one set of readings that Newton's steps from a grid of starts arrive at, shape (n, 3), mm."""
    axes = [np.linspace(a + 0.01, b - 0.01, n) for a, b, n in zip(coder.low, coder.high, counts, strict=True)]
    starts = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    target = np.repeat(field[:, None], starts.shape[1], axis=1)
    low, high = coder.low - 0.5, coder.high + 0.5
    s, f, A, done = damped_newton.refine(coder.forward, starts, target, np.ones(len(field)), low, high)
    inside = ((s > coder.low[:, None] - 1e-6) & (s < coder.high[:, None] + 1e-6)).all(axis=0)
    exact = np.sqrt((f**2).sum(axis=0)) < 1e-7 * np.sqrt((A**2).sum(axis=(0, 1)))
    distinct: list[Array] = []
    for pose in s[:, done & inside & exact].T:
        if not _among(pose, distinct):
            distinct.append(pose)
    return np.array(distinct).reshape(-1, 3)


def _among(pose: Array, others: list[Array] | Array) -> bool:
    return any(np.abs(pose - other).max() < 2e-5 for other in others)


SAMPLES = 1000


def speed(count: int = 8192, runs: int = 3) -> list[DecoderSpeed]:
    """Decodings a second of many at once and of a stream, in NumPy alone and with the compiled field."""
    speeds = []
    for program, how in (("NumPy", compiled.uncompiled), ("compiled field", contextlib.nullcontext)):
        for name in ("paper (h 2, l0 7.2, c 2)", "h 4, l0 6, c 4", "3-axis chip"):
            with how():
                many, took, some = _timed(name, count, runs)
            speeds.append(DecoderSpeed(program, name, per_s=some / many, stream_Hz=SAMPLES / took))
    return speeds


def _timed(name: str, count: int, runs: int) -> tuple[float, float, int]:
    """Time for so many decodings at once and for a stream of SAMPLES, s; and how many the many were."""
    coder = coder_of(Design(**LAYOUTS[name]), TAUS[1])  # type: ignore[arg-type]
    # folded layouts take a hundred times as long
    some = count // 16 if "c 4" in name else count
    field = poses(coder, some)[1].T
    many = statistics.median(_cpu(partial(decode.decode, coder, field)) for _ in range(runs))
    follower = stream.Stream(coder)
    t = np.linspace(0, 10, SAMPLES)
    path = np.stack([1.5 * np.sin(1.1 * t), 1.5 * np.cos(1.7 * t), -1.1 + 0.9 * np.sin(0.6 * t)])
    samples = [(a, b, c) for a, b, c in forward_model.readings_at(coder.forward, path).T.tolist()]
    return many, statistics.median(_clock(follower, samples) for _ in range(runs)), some


def _clock(follower: stream.Stream, samples: list[stream.Vector]) -> float:
    begin = time.perf_counter()
    for sample in samples:
        follower.step(sample)
    return time.perf_counter() - begin


def _cpu(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def ignored(coder: Decoder, count: int = 2000) -> TiltErrors:
    """Errors of shift and force where the magnet tilts and the decoder does not know it."""
    shift, field = poses(coder, count, seed=4)
    flat = decode.decoder(
        coder.forward.design,
        coder.mechanics,
        ignore_tilt=True,
        elements=coder.forward.elements,
        workspace=(coder.low - 0.5, coder.high + 0.5),
    )
    found = decode.decode(flat, field.T, near=np.zeros(3))
    good = (found.multiplicity > 0) & np.isfinite(found.force[:, 2])
    error = np.linalg.norm(found.shift[good] - shift.T[good], axis=1)
    assert coder.mechanics is not None
    force = response_surface.forces(coder.mechanics, shift)[0].T[good]
    wrong = np.abs(found.force[good] - force)
    return TiltErrors(
        no_pose=float(1 - good.mean()),
        median_mm=float(np.median(error)),
        worst_mm=float(error.max()),
        lateral_N=float(np.median(np.hypot(wrong[:, 0], wrong[:, 1]))),
        normal_N=float(np.median(wrong[:, 2])),
        largest_lateral_N=float(np.hypot(force[:, 0], force[:, 1]).max()),
        largest_normal_N=float(force[:, 2].max()),
    )


def main(out: str, full: str | None = None) -> None:
    """Measure, and write DECODE.md into a folder; with the paper's table if its file is named."""
    with atomic_files.filled(out) as folder:
        about = benchmark_tables.machine()
        magnet.compiled()
        trips = round_trips()
        console.say("round trips done")
        second_poses = searches()
        console.say("searches done")
        tables = lookup_benchmark.steps()
        whole = None if full is None else lookup_benchmark.whole(Path(full))
        console.say("tables done")
        tilts = {"the paper's formulas, tau 0.2 rad/mm, the whole workspace": ignored(coder_of(paper(), 0.2))}
        states, law = folder / "states.jsonl", None
        if states.exists():
            law = decode_readings.of_file(states, paper())
            tilts["finite elements (states.jsonl), within their range"] = ignored(decode.decoder(paper(), law))
        console.say("tilt done")
        measurements = Measurements(trips, second_poses, tables, whole, tilts, law, speed())
        atomic_files.write_text(folder / "DECODE.md", decoder_report.report(measurements, about, ABOUT))


if __name__ == "__main__":
    main(*(sys.argv[1:3] or [str(Path("out", "decode"))]))
