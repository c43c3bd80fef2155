"""The exported decoder in C beside the decoder in Python: on this machine, under sanitizers, and on a Cortex-M4F.

`firmware_run.c` decodes a file of rows. QEMU emulates the Cortex-M4F and counts instructions; sizes are those of a
whole program with -Os, functions of math.h and some 0.7 kB of the program around the decoder included.
"""

import dataclasses
import math
import shutil
import subprocess
import tempfile
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analytic.decode import Decoder
from analytic.inverse import response_surface
from analytic.parts import with_noise
from geometry.arrays import Array, Mask
from geometry.bad_input import BadInput
from geometry.design import Design
from geometry.messages import Progress
from studies.calibration import (
    bench_file,
    calibrated_forces,
    calibration_file,
    calibration_study,
    press_plan,
    sensor_fit,
    simulated_bench,
)
from studies.firmware import decoder_export
from studies.firmware.decoder_export import STATUSES, Firmware
from studies.inputs.option_groups import Exporting, SourceOfLoad
from studies.output.goals import Goal
from studies.output.result import Result
from studies.parts.part_tolerances import tolerances
from studies.sensitivity.made_sensors import made_sensors
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("FIRMWARE.md", "firmware.csv")
HERE = Path(__file__).parent
PLAN: dict[str, Any] = tomllib.loads((HERE / "firmware_plan.toml").read_text("utf-8"))
"""Designs, numbers of rows, goals and compilers' options."""
STRICT: list[str] = PLAN["flags"]["strict"].split()
STEP = 1e-3
"""Distance, mm, from rest and from shifts at which the plate begins to touch, within which rows are left out of the
errors: there the decoder's lateral force has a step. Above rest its edge is a distance aside."""
ANSWER, REJECTING_ANSWER = (
    np.dtype({
        "names": ["status", "poses", "shift", "tilt", "force", "half_width", *ambient, "instructions", "stack"],
        "formats": ["<i4", "<i4", "3<f4", "2<f4", "3<f4", "3<f4", *["3<f4"] * len(ambient), "<u4", "<u4"],
    })
    for ambient in ([], ["ambient"])
)  # fmt: skip
"""A record of answers.bin, also of a decoder that rejects an ambient field."""


def beside_steps(coder: Decoder, shift: Array) -> Mask:
    """Return whether the plate begins to touch within `STEP` above, below or beside shifts (n, 3), mm."""
    assert coder.mechanics is not None
    aside = STEP * shift / np.maximum(np.linalg.norm(shift[:, :2], axis=1, keepdims=True), STEP) * [1.0, 1.0, 0.0]
    up = np.array([0.0, 0.0, STEP])
    touches = [
        np.abs(response_surface.force_and_load(coder.mechanics, at.T)[0]).max(axis=0) > 0
        for at in (shift - up, shift + up, shift - aside, shift + aside)
    ]
    return np.asarray(np.any(touches, axis=0) & ~np.all(touches, axis=0))


def write_header(firmware: Firmware, folder: Path) -> None:
    (folder / "magtip_decoder.h").write_text(decoder_export.header(firmware, "magtip firmware"), "utf-8")


def compiled(folder: Path, compiler: str, flags: Sequence[str], name: str = "run") -> Path:
    _run([compiler, *flags, "-I.", str(HERE / "firmware_run.c"), "-o", name, "-lm"], folder)
    return folder / name


def for_target(folder: Path, optimised: str = "-Os") -> tuple[Path, int, int]:
    """Compile for a Cortex-M4F; return the program, its bytes of flash, and of RAM without the stack."""
    flags = [*PLAN["flags"]["target"].split(), optimised, "-T", str(HERE / "firmware_m4.ld")]
    program = compiled(folder, "arm-none-eabi-gcc", flags, "run.elf")
    sizes = _run(["arm-none-eabi-size", program.name], folder).splitlines()[1].split()
    text, data, bss = map(int, sizes[:3])
    return program, text + data, data + bss


def answers(
    program: Path,
    outputs: Array,
    seconds: Array | None = None,
    temperature: Array | None = None,
    kind: np.dtype[Any] = ANSWER,
) -> NDArray[Any]:
    """Return what a program decodes from outputs (n, 3), and from a time series with the seconds before each row.

    temperature : (n,), C, for a decoder that takes one.
    kind : of its records.
    """
    before = np.full(len(outputs), np.nan) if seconds is None else seconds
    columns = [outputs, before] + ([] if temperature is None else [temperature])
    np.column_stack(columns).astype("<f4").tofile(program.parent / "rows.bin")
    emulator = ["qemu-system-arm", *PLAN["flags"]["qemu"].split()] if program.suffix == ".elf" else []
    _run([*emulator, str(program)], program.parent)
    return np.fromfile(program.parent / "answers.bin", kind)


def _run(command: Sequence[str], folder: Path) -> str:
    if shutil.which(command[0]) is None:
        raise BadInput(f"{command[0]} is not installed: install gcc, gcc-arm-none-eabi and qemu-system-arm")
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=1200)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def random_outputs(coder: Decoder, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    shift = rng.uniform(coder.low, coder.high, (count, 3)).T
    return decoder_export.outputs_at(coder, shift), shift


def series_outputs(coder: Decoder, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return outputs (n, 3) and times (n,), s, of presses and shears with noise, gaps, bad rows and jumps."""
    t, elements = 0.005 * np.arange(count), coder.forward.elements
    w, x, y = 0.45 * (1 - np.cos(2 * np.pi * 0.7 * t)), 0.5 * np.sin(2 * np.pi * 0.3 * t), 0.5 * np.sin(2 * np.pi * t)
    shift = np.stack([x * w * coder.high[0], y * w * coder.high[1], w * coder.low[2]])
    outputs = decoder_export.outputs_at(coder, shift)
    outputs = outputs + np.array([e.noise_T * e.gain for e in elements]) * rng.normal(size=outputs.shape)
    outputs[count // 5, 0], outputs[count // 4], outputs[count // 3] = np.nan, 1.1 * elements[0].high, outputs[3]
    outputs[count // 2 : count // 2 + 25, 1] = outputs[count // 2, 1]
    gaps = np.cumsum(rng.random(count) < 0.005) * 0.05
    return (v.astype(np.float32).astype(float) for v in (outputs, t + gaps))  # type: ignore[return-value]


def hostile_outputs(coder: Decoder, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return random outputs (n, 3) with NaN, infinities, rails and huge numbers, and times, some of them bad."""
    low, high = (np.array([getattr(e, name) for e in coder.forward.elements]) for name in ("low", "high"))
    outputs = rng.uniform(low - 0.1 * (high - low), high + 0.1 * (high - low), (count, 3))
    near, _ = random_outputs(coder, count, rng)
    some = rng.random(count) < 0.4
    outputs[some] = near[some]
    bad = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, 0.0, low[0], high[0]])
    where = rng.random((count, 3)) < 0.1
    outputs[where] = rng.choice(bad, int(where.sum()))
    seconds = rng.choice([1e-3, 1e-3, 0.0, 1e-30, -1.0, np.nan, np.inf, 3e38, 10.0], count)
    return outputs, seconds


def differences(
    found: NDArray[Any], expected: dict[str, Any], full: float, truth: Array | None = None
) -> dict[str, float]:
    """Return how answers differ from `decoder_export.reference`: statuses, force (% of `full`), shift (um).

    Half widths of the force are compared where they are `expected`: the largest difference, how much narrower one
    is, and how much wider the median one, in %; without bound where one is not finite.

    truth : shifts (3, n), mm; rows in which Python misses its own shift are left out.
    """
    words = np.array(STATUSES)[found["status"]]
    known = np.isfinite(found["force"][:, 2]) & np.isfinite(expected["force"][:, 2])
    # which of several poses is nearest depends on the row before
    known &= (np.abs(expected["shift"][:, 2]) > STEP) & (expected["poses"] == 1)
    known &= np.logical_not(expected.get("beside_steps", False))
    if truth is not None:
        known &= np.abs(expected["shift"] - truth.T).max(axis=1) < STEP
    # without a pose to compare the difference is unknown, not 0
    force, shift = (
        float(np.abs(found[name] - expected[name])[known].max()) if known.any() else math.nan
        for name in ("force", "shift")
    )
    off = {
        "statuses_percent": 100 * float((words != np.array(expected["status"])).mean()),
        "force_percent": 100 * force / full,
        "shift_um": 1e3 * shift,
    }
    if "half_width" not in expected:
        return off
    more = 100 * (found["half_width"][known] / expected["half_width"][known] - 1)
    more = np.where(np.isfinite(more), more, -math.inf) if known.any() else np.array([math.nan])
    wider = {"half_width": np.abs(more).max(), "narrower": np.max(-more), "wider": np.median(more)}
    return off | {f"{name}_percent": float(value) for name, value in wider.items()}


def expected_half_widths(firmware: Firmware, path: Path | None, outputs: Array, shift: Array) -> Array:
    """Return half widths of the force by Python, N, shape (n, 3), at outputs with their shifts, NaN without one.

    path : of a calibration.
    """
    if path is not None:
        found = calibration_file.of_design(path, firmware.design)
        return calibrated_forces.decode(found, outputs, np.zeros(len(outputs))).half_width
    sigma = np.array([element.noise_T for element in with_noise(firmware.coder.forward.elements)[0]])
    known, half = np.isfinite(shift).all(axis=1), np.full(shift.shape, np.nan)
    half[known] = decoder_export.half_widths(firmware.coder, sigma, shift[known])
    return half


def hostile_faults(program: Path, coder: Decoder, count: int) -> tuple[int, float]:
    """Return the number of rows whose force contradicts their status, and the share with a force, %.

    A fault that a sanitizer finds ends the program with an error.
    """
    outputs, seconds = hostile_outputs(coder, count, np.random.default_rng(2))
    found = answers(program, outputs, seconds)
    force = np.isfinite(found["force"]).all(axis=1)
    silent = np.isin(found["status"], [STATUSES.index(w) for w in ("ok", "uncalibrated", "after_gap", "jump")])
    mute = ~silent & (found["status"] != STATUSES.index("ambiguous"))
    unusable = ~np.isfinite(outputs.astype(np.float32)).all(axis=1)
    wrong = (silent & ~force) | (mute & force) | (unusable & force) | ~np.isin(found["status"], range(len(STATUSES)))
    return int(wrong.sum()) + (len(found) != count), 100 * float(force.mean())


def calibration(folder: Path) -> Path:
    """Write the calibration of a made sensor, as a simulated bench finds it."""
    design, made = Design(), tolerances()
    plan = press_plan.plan(design, made, None, count=PLAN["presses"])
    stand, one = simulated_bench.Stand(plan.sensor.force_noise), made_sensors(design, made, 1, PLAN["seed"])
    rows = simulated_bench.bench(plan, one, stand, PLAN["seed"], lambda share, text: None)
    rows.to_csv(folder / "bench.csv", index=False)
    bench = bench_file.read([folder / "bench.csv"], design)
    un = sensor_fit.unknowns_of(design, bench, made, model_error=calibration_study.mechanics_of(design, None)[2])
    sensor = dataclasses.replace(plan.sensor, unknowns=un)
    found = sensor_fit.fit(sensor, sensor_fit.measured_of(bench), sensor_fit.warmer_of(sensor, bench))
    path = folder / "calibration.json"
    path.write_text(calibration_file.as_text(found, plan.mechanics_source, None), "utf-8")
    return path


def rows_of(kind: str, fewer: int) -> int:
    """Return the number of rows of a kind of the plan with `fewer` by this factor; a series has at least 200."""
    return max(int(PLAN["rows"][kind]) // fewer, 200 if kind == "series" else 1)


def judge(case: Row, fewer: int) -> Row:
    """Return the differences of a design's decoder; with `fewer` by this factor of the rows."""
    level, flash = case["level"], case["flash"]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        found = calibration(folder) if level == "calibrated" else None
        own = None if level == "calibrated" else level
        options = Exporting(flash=flash, source=SourceOfLoad(level=own), calibration=found)
        firmware = decoder_export.prepare(Design(**case["fields"]), options)
        coder, rng = firmware.coder, np.random.default_rng(1)
        outputs, shift = random_outputs(coder, rows_of("single", fewer), rng)
        series, times = series_outputs(coder, rows_of("series", fewer), rng)
        expected = decoder_export.reference(coder, firmware.made, outputs)
        expected["half_width"] = expected_half_widths(firmware, found, outputs, expected["shift"])
        expected["beside_steps"] = beside_steps(coder, expected["shift"])
        over_time = decoder_export.reference(coder, firmware.made, series, times)
        full, seconds = float(np.nanmax(np.abs(expected["force"]))), np.diff(times, prepend=times[0])
        write_header(firmware, folder)
        host = compiled(folder, "gcc", [*STRICT, "-O2"])
        off = differences(answers(host, outputs), expected, full, shift)
        timed = differences(answers(host, series, seconds), over_time, full)
        program, size, ram = for_target(folder)
        few = slice(rows_of("on_target", fewer))
        there, timed_there = answers(program, outputs[few]), answers(program, series, seconds)
    target = differences(there, {k: v[few] for k, v in expected.items()}, full, shift[:, few])
    both = [target, differences(timed_there, over_time, full)]
    off |= {f"series_{key}": timed[key] for key in ("statuses_percent", "force_percent")}
    used = np.concatenate([there, timed_there])
    row = {"design": case["name"], "level": level, "flash": flash, "folds": case.get("folds", False), **off}
    off = {name: max(off[name], target[name]) for name in ("half_width_percent", "narrower_percent", "wider_percent")}
    return (
        row
        | off
        | {
            "target_force_percent": max(one["force_percent"] for one in both),
            "instructions_median": int(np.median(used["instructions"])),
            "instructions_most": int(used["instructions"].max()),
            "flash_bytes": size,
            "ram_bytes": ram + int(used["stack"].max()),
            "full_scale_N": full,
        }
    )


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Compare the decoder in C with Python, also on a Cortex-M4F and under sanitizers; exit status 3 if a goal fails.

    It needs gcc, gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm.

    Parameters
    ----------
    quick
        Decode a hundredth of the rows: seconds instead of minutes.
    """
    fewer = PLAN["quick"] if quick else 1
    chosen = pages.told(progress, PLAN["case"], lambda case: f"{case['name']}, {case['flash']}")
    rows, hostile = [judge(case, fewer) for case in chosen], rows_of("hostile", fewer)
    progress(0.9, "sanitizers")
    firmware = decoder_export.prepare(Design(), Exporting())
    with tempfile.TemporaryDirectory() as place:
        write_header(firmware, Path(place))
        program = compiled(Path(place), "gcc", PLAN["flags"]["sanitized"].split())
        faults, share = hostile_faults(program, firmware.coder, hostile)
    tools = ("gcc", "arm-none-eabi-gcc", "qemu-system-arm")
    page: Row = {"rows": rows, "share": share, "singles": rows_of("single", fewer), "hostile": hostile}
    page |= {"presses": PLAN["presses"], "step_um": 1e3 * STEP}
    page["versions"] = [_run([tool, "--version"], HERE).splitlines()[0] for tool in tools]
    posed = [*goals(rows, fewer), Goal("faults under hostile readings", faults, 0, hostile)]
    return pages.study("firmware", "Firmware", rows, page, goals=posed)


def goals(rows: Sequence[Row], fewer: int) -> list[Goal]:
    """Return the goals of the plan, and those of the flash, for designs that decoded `fewer` rows by this factor."""
    table = pd.DataFrame(rows)
    found = []
    for goal in PLAN["goals"]:
        among = table.query(goal.get("among", "design == design"))
        # one design that is not known misses the goal
        largest = float(among[goal["column"]].max(skipna=False))
        # of a few rows a single one is more than the share
        most = max(goal["most"], 100 / rows_of(goal["rows"], fewer)) if "rows" in goal else goal["most"]
        found.append(Goal(goal["name"], largest, most, len(among), goal["unit"]))
    for flash, own in table.groupby("flash", sort=False):
        size, most = int(own.flash_bytes.max()), decoder_export.bytes_of(str(flash))
        found.append(Goal(f"flash with --flash {flash}", size, most, len(own), "bytes"))
    return found
