"""The exported decoder in C: answers of Python, warnings and sanitizers, a Cortex-M4F, sketches, and bad input."""

import ctypes
import dataclasses
import json
import math
import re
import shutil
import subprocess

import numpy as np
import pytest
from conftest import take_surrogate
from numpy.testing import assert_allclose, assert_array_equal

from analytic import beam_arrays
from analytic.decode import decode, field_of
from analytic.hall import field_at
from analytic.time_series import RelaxingForce
from geometry.array_design import grid_array
from geometry.design import Design, paper
from studies.calibration import calibration_file
from studies.cli import main
from studies.firmware import decoder_export
from studies.firmware.decoder_export import STATUSES
from studies.inputs.option_groups import Exporting, SourceOfLoad
from studies.output.goals import missed
from studies.parts.requirements import Requirements
from studies.sensing import decode_readings
from studies.validation.devices import firmware_check

pytestmark = pytest.mark.calibrates

THREE_CHIPS = {"hall_layout": "tlv493d-a1b6", "chip_count": 3, "chip_x": 5.0}

LIBRARY = """
#include "magtip_decoder.h"
static magtip_sensor sensor;
void set_up(void); void set_up(void) { magtip_set_up(&sensor); }
int zero(const float *r); int zero(const float *r) { return (int)magtip_zero(&sensor, r); }
void one(const float *r, magtip_answer *a);
void one(const float *r, magtip_answer *a) { magtip_decode(&sensor, r, a); }
void step(const float *r, float s, magtip_answer *a);
void step(const float *r, float s, magtip_answer *a) { magtip_step(&sensor, r, s, a); }
"""


def needs(*programs):
    missing = [name for name in programs if shutil.which(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")


@pytest.fixture(scope="module")
def firmware():
    return decoder_export.prepare(paper(), Exporting(flash="16k", source=SourceOfLoad(level="finite")))


@pytest.fixture(scope="module")
def chip():
    """A chip whose noise moves its converter, so that a repeated value is frozen."""
    return decoder_export.prepare(Design(hall_layout="tlv493d-a1b6"), Exporting())


class Answer(ctypes.Structure):
    _fields_ = [("status", ctypes.c_int), ("poses", ctypes.c_int)] + [
        (name, ctypes.c_float * n) for name, n in (("shift", 3), ("tilt", 2), ("force", 3), ("half_width", 3))
    ]


@pytest.fixture(scope="module")
def library(chip, tmp_path_factory):
    """The chip's decoder as a shared library, called row by row."""
    if shutil.which("gcc") is None:
        pytest.skip("not installed: gcc")
    folder = tmp_path_factory.mktemp("library")
    firmware_check.write_header(chip, folder)
    (folder / "library.c").write_text(LIBRARY)
    command = ["gcc", *firmware_check.STRICT, "-O0", "-shared", "-fPIC", "library.c", "-o", "library.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    loaded = ctypes.CDLL(str(folder / "library.so"))
    loaded.step.argtypes = [ctypes.c_void_p, ctypes.c_float, ctypes.c_void_p]

    def call(name, reading, *more):
        row, found = np.asarray(reading, dtype=np.float32), Answer()
        getattr(loaded, name)(ctypes.c_void_p(row.ctypes.data), *more, ctypes.byref(found))
        return STATUSES[found.status], found

    loaded.set_up()
    call.loaded = loaded
    return call


def test_neither_a_name_nor_a_folder_leaves_its_comment(firmware):
    evil = "x */ static int evil = 42; /*"
    hostile = dataclasses.replace(firmware, design=Design(silicone=evil), source=evil)
    header = decoder_export.header(hostile, f"magtip firmware --out '{evil}\n*/'")
    assert header.count("static int evil") == 3
    code = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    assert "evil" not in code
    assert "*/" not in code


@pytest.mark.parametrize("compiler", [pytest.param(name, marks=needs(name)) for name in ("gcc", "clang")])
def test_c_is_python_over_the_workspace_and_over_time(firmware, compiler, tmp_path):
    coder, rng = firmware.coder, np.random.default_rng(0)
    firmware_check.write_header(firmware, tmp_path)
    program = firmware_check.compiled(tmp_path, compiler, [*firmware_check.STRICT, "-O0"])
    outputs, truth = firmware_check.random_outputs(coder, 1500, rng)
    expected = decoder_export.reference(coder, firmware.made, outputs)
    expected["half_width"] = firmware_check.expected_half_widths(firmware, None, outputs, expected["shift"])
    full = np.nanmax(np.abs(expected["force"]))
    found = firmware_check.answers(program, outputs)
    off = firmware_check.differences(found, expected, full, truth)
    assert off["statuses_percent"] == 0
    # the goal is 0.5 %, float alone leaves 0.001 %
    assert off["force_percent"] < 0.02
    assert off["force_percent"] < 100 * firmware.errors[1] / firmware.errors[2] + 0.005
    assert off["half_width_percent"] < 0.1
    found["half_width"][:3] *= [[0.5], [1.0], [1.0]]
    assert firmware_check.differences(found, expected, full, truth)["half_width_percent"] == pytest.approx(
        50, abs=0.1
    )
    found["half_width"][:3] = np.nan
    off = firmware_check.differences(found, expected, full, truth)
    assert off["half_width_percent"] == off["narrower_percent"] == np.inf
    assert_allclose(found["tilt"], expected["tilt"], atol=1e-4)
    assert_array_equal(found["poses"], expected["poses"])
    series, times = firmware_check.series_outputs(coder, 400, rng)
    timed = decoder_export.reference(coder, firmware.made, series, times)
    off = firmware_check.differences(
        firmware_check.answers(program, series, np.diff(times, prepend=times[0])), timed, full
    )
    assert off["statuses_percent"] == 0
    assert off["force_percent"] < 0.02
    assert {"ok", "after_gap", "jump", "not_finite", "saturated"} <= set(timed["status"])


def test_goals_see_half_widths_and_allow_one_row_of_a_few():
    good = {goal["column"]: 0.0 for goal in firmware_check.PLAN["goals"]} | {"flash_bytes": 9}
    rows = [good | {k: c.get(k, False) for k in ("level", "flash", "folds")} | {"design": c["name"]}
            for c in firmware_check.PLAN["case"]]  # fmt: skip

    def lost(fewer, level, **changes):
        changed = [row | (changes if row["level"] == level else {}) for row in rows]
        return [goal.name for goal in missed(firmware_check.goals(changed, fewer))]

    assert lost(1, "finite") == []
    assert lost(1, "finite", half_width_percent=2.0) == ["half widths, off from Python, without folds"]
    # a calibration's are rounded up, and may not be narrow
    assert lost(1, "calibrated", half_width_percent=40.0, wider_percent=10.0) == []
    assert lost(1, "calibrated", narrower_percent=30.0) == ["half widths of calibrations, less than in Python"]
    assert len(lost(100, "finite", half_width_percent=np.nan)) == 1
    # 0.5 % are one row of the 200 of a quick run
    assert lost(100, "finite", statuses_percent=0.5, series_statuses_percent=0.5) == []
    assert len(lost(100, "finite", statuses_percent=1.0, series_statuses_percent=1.0)) == 2
    assert len(lost(1, "finite", statuses_percent=0.5, series_statuses_percent=0.5)) == 2


@needs("gcc")
def test_folds_are_ambiguous_as_in_python(tmp_path):
    firmware = decoder_export.prepare(
        Design(**firmware_check.PLAN["case"][-1]["fields"]), Exporting(source=SourceOfLoad(level="paper"))
    )
    firmware_check.write_header(firmware, tmp_path)
    program = firmware_check.compiled(tmp_path, "gcc", [*firmware_check.STRICT, "-O0"])
    outputs, truth = firmware_check.random_outputs(firmware.coder, 1500, np.random.default_rng(3))
    expected = decoder_export.reference(firmware.coder, firmware.made, outputs)
    found = firmware_check.answers(program, outputs)
    words, several = np.array(STATUSES)[found["status"]], np.array(expected["status"]) == "ambiguous"
    assert several.sum() >= 3
    assert (words[several] == "ambiguous").mean() > 0.6
    assert (words == np.array(expected["status"])).mean() > 0.95
    assert firmware_check.differences(found, expected, np.nanmax(expected["force"]), truth)["force_percent"] < 0.5


@needs("gcc")
def test_several_chips_decode_as_python_and_may_contradict_each_other(tmp_path):
    firmware = decoder_export.prepare(Design(**THREE_CHIPS), Exporting())
    firmware_check.write_header(firmware, tmp_path)
    program = firmware_check.compiled(tmp_path, "gcc", [*firmware_check.STRICT, "-O0"])
    outputs, truth = firmware_check.random_outputs(firmware.coder, 600, np.random.default_rng(4))
    outputs[500:, 4] += 2e-3
    expected = decoder_export.reference(firmware.coder, firmware.made, outputs)
    found = firmware_check.answers(program, outputs)
    words, right = np.array(STATUSES)[found["status"]], np.array(expected["status"])
    assert (words[:500] == right[:500]).mean() > 0.99
    off = firmware_check.differences(found, expected, firmware.errors[2], truth)
    assert off["force_percent"] < 0.02
    assert "inconsistent" in words[500:]
    assert set(words[500:]) <= {"inconsistent", "out_of_workspace"}


@needs("gcc")
def test_a_rejected_field_gives_no_force_in_c_and_is_found_as_in_python(tmp_path):
    design = Design(**THREE_CHIPS | {"chip_noise": 5e-5})
    firmware = decoder_export.prepare(design, Exporting(reject_ambient=True))
    firmware_check.write_header(firmware, tmp_path)
    program = firmware_check.compiled(tmp_path, "gcc", [*firmware_check.STRICT, "-O0"])
    outputs, truth = firmware_check.random_outputs(firmware.coder, 400, np.random.default_rng(4))
    # chips read in T, along x, y or z
    field = np.random.default_rng(1).uniform(-1e-3, 1e-3, (400, 3))
    disturbed = outputs + field @ np.array([e.direction for e in firmware.coder.forward.elements]).T
    expected = decoder_export.reference(firmware.coder, firmware.made, disturbed)
    expected["half_width"] = firmware_check.expected_half_widths(firmware, None, outputs, expected["shift"])
    found = firmware_check.answers(program, disturbed, kind=firmware_check.REJECTING_ANSWER)
    off = firmware_check.differences(found, expected, firmware.errors[2], truth)
    assert off["statuses_percent"] < 0.5
    assert off["force_percent"] < 0.05
    assert off["half_width_percent"] < 1
    assert_allclose(expected["ambient"], field, atol=1e-6)
    known = np.isfinite(found["ambient"][:, 0])
    assert known.mean() > 0.99
    assert_allclose(found["ambient"][known], field[known], atol=5e-6)


ARRAY_LIBRARY = """
#include "magtip_decoder.h"
static magtip_array array;
int size(void); int size(void) { return (int)sizeof array; }
void set_up(void); void set_up(void) { magtip_array_set_up(&array); }
void zero(float *r); void zero(float *r) { magtip_array_zero(&array, (float (*)[MAGTIP_ELEMENTS])r); }
void step(float *r, float s, magtip_answer *a);
void step(float *r, float s, magtip_answer *a) { magtip_array_step(&array, (float (*)[MAGTIP_ELEMENTS])r, s, a); }
"""


def test_moments_have_the_field_of_the_magnet_beyond_its_sphere():
    design, x = paper(), np.array([[7.0, -3.0, 4.0], [9.0, 0.0, 1.0]])
    d, m = np.linalg.norm(x, axis=1, keepdims=True), np.array([0.0, 0.0, 1.0])
    B = np.zeros_like(x)
    for n, K in zip(decoder_export.MOMENTS, decoder_export.moments_of(design), strict=True):
        P = np.polynomial.Legendre.basis(n)
        u = x[:, 2:] / d
        B += K / d ** (n + 2) * ((n + 1) * P(u) * x / d + P.deriv()(u) * (u * x / d - m))
    assert_allclose(B, field_at(x + np.array([0, 0, design.H]), design), rtol=2e-4, atol=1e-4 * np.abs(B).max())


@needs("gcc")
def test_an_array_in_c_subtracts_its_neighbours_once_as_python_does(tmp_path):
    array = grid_array(paper(), 2, 2, 14.0, "checkerboard")
    firmware = decoder_export.prepare(paper(), Exporting(flash="20k"), array=array)
    firmware_check.write_header(firmware, tmp_path)
    (tmp_path / "library.c").write_text(ARRAY_LIBRARY)
    command = ["gcc", *firmware_check.STRICT, "-O0", "-shared", "-fPIC", "library.c", "-o", "library.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    loaded = ctypes.CDLL(str(tmp_path / "library.so"))
    loaded.step.argtypes = [ctypes.c_void_p, ctypes.c_float, ctypes.c_void_p]
    random = np.random.default_rng(3).uniform([-0.5, -0.5, -0.9], [0.5, 0.5, -0.1], (20, 4, 3))
    fields = beam_arrays.readings_of_array(firmware.array, random)
    expected = decoder_export.reference_of_array(firmware.coder, firmware.array, fields)
    e, drift = firmware.coder.forward.elements[0], 2e-3

    def answers(fields):
        outputs, found = (e.null + e.gain * fields).astype(np.float32), (Answer * 4)()
        loaded.step(ctypes.c_void_p(outputs.ctypes.data), 1e3, ctypes.byref(found))
        return np.array([list(one.shift) for one in found])

    assert loaded.size() == firmware.state
    loaded.set_up()
    found = np.array([answers(frame) for frame in fields]).reshape(-1, 3)
    known = np.isfinite(expected.shift[:, 2]) & (expected.multiplicity == 1)
    assert known.mean() > 0.8
    # the poles, and what three moments leave of the neighbours' field
    assert_allclose(found[known], expected.shift[known], atol=2e-3)
    assert np.median(np.abs(found[known] - random.reshape(-1, 3)[known])) > 1e-4
    # a zero takes a drift off
    rest = beam_arrays.readings_of_array(firmware.array, np.zeros((1, 4, 3)))[0] + drift
    outputs = (e.null + e.gain * rest).astype(np.float32)
    loaded.zero(ctypes.c_void_p(outputs.ctypes.data))
    assert_allclose(answers(fields[0] + drift)[known[:4]], found[:4][known[:4]], atol=2e-3)


@needs("gcc")
def test_hostile_readings_under_sanitizers(chip, tmp_path):
    firmware_check.write_header(chip, tmp_path)
    # without optimisation it is compiled five times as fast
    program = firmware_check.compiled(
        tmp_path, "gcc", [*firmware_check.PLAN["flags"]["sanitized"].split(), "-O0", "-g0"]
    )
    faults, share = firmware_check.hostile_faults(program, chip.coder, 3_000)
    assert faults == 0
    assert share > 5


def test_rows_beside_the_step_of_first_touch_are_known(chip):
    shift = np.array([[0.0, 0.0, -2e-4], [0.1, 0.0, 2e-4], [0.0, 0.0, -0.3], [0.2, -0.1, 0.05]])
    assert firmware_check.beside_steps(chip.coder, shift).tolist() == [True, True, False, False]


def test_the_calibration_of_the_study_knows_its_sensor(monkeypatch, tmp_path):
    """By few presses, with the mechanics of the surrogate; the row at rest tells the nulls."""
    take_surrogate(monkeypatch)
    monkeypatch.setitem(firmware_check.PLAN, "presses", 4)
    found = calibration_file.of_design(firmware_check.calibration(tmp_path), paper())
    null = found.sensor.unknowns.names.index("null_S1")
    assert found.deviation[null] < 0.3 * found.sensor.unknowns.deviation[null]


@needs("arm-none-eabi-gcc", "qemu-system-arm")
@pytest.mark.parametrize(("fields", "rejects"), [({}, False), ({"chip_count": 3, "chip_x": 5.0}, True)])
def test_code_for_the_target_is_as_large_as_is_said(fields, rejects, tmp_path):
    layout = {"hall_layout": "tmag5273a1", "chip_noise": 5e-5} if fields else {}
    firmware = decoder_export.prepare(Design(**layout, **fields), Exporting(flash="20k", reject_ambient=rejects))
    firmware_check.write_header(firmware, tmp_path)
    size = firmware_check.for_target(tmp_path)[1]
    assert size <= firmware.flash < size + 150


@needs("arm-none-eabi-gcc", "qemu-system-arm")
def test_the_target_gives_the_same_answers_within_its_limits(firmware, tmp_path):
    firmware_check.write_header(firmware, tmp_path)
    program, flash, ram = firmware_check.for_target(tmp_path)
    outputs, truth = firmware_check.random_outputs(firmware.coder, 60, np.random.default_rng(1))
    expected = decoder_export.reference(firmware.coder, firmware.made, outputs)
    found = firmware_check.answers(program, outputs)
    off = firmware_check.differences(found, expected, firmware.errors[2], truth)
    assert (off["statuses_percent"], off["force_percent"] < 0.02) == (0, True)
    most = {goal["column"]: goal["most"] for goal in firmware_check.PLAN["goals"]}
    assert 1000 < found["instructions"].max() < most["instructions_most"]
    assert flash < 16384
    assert ram + found["stack"].max() < most["ram_bytes"]


def test_the_interval_is_that_of_noise_fit_and_branches(chip, library):
    outputs = decoder_export.outputs_at(chip.coder, np.array([[0.3, -0.2, -0.6], [0.1, 0.2, -0.9]]).T)
    found = decode(chip.coder, field_of(chip.coder.forward.elements, outputs))
    fit = chip.coder.mechanics.errors
    expected = decoder_export.QUANTILE * np.hypot(found.noise_N, np.array([fit[1], fit[1], fit[2]]) / 2)
    library.loaded.set_up()
    for output, half in zip(outputs, expected, strict=True):
        assert_allclose(list(library("one", output)[1].half_width), half, rtol=2e-3)
    # a fast press: the force changes with doubted branches
    design = chip.coder.forward.design
    laws = [RelaxingForce(design), *(RelaxingForce(design, b) for b in decode_readings.doubted_branches(design))]
    rest = decoder_export.outputs_at(chip.coder, np.zeros((3, 1)))[0]
    library("step", rest, 0.0)
    _, answer = library("step", outputs[0], 0.01)
    for law in laws:
        law.step(0.0, np.zeros(3), np.zeros(2))
    forces = [law.step(0.01, found.force[0], found.load[0, 1:]) for law in laws]
    assert_allclose(list(answer.force), forces[0], rtol=1e-4, atol=1e-4)
    assert np.linalg.norm(forces[0] - found.force[0]) > 0.2 * np.linalg.norm(found.force[0])
    assert min(answer.half_width) > max(np.linalg.norm(force - forces[0]) for force in forces[1:])


def test_zero_and_frozen(chip, library):
    coder, loaded = chip.coder, library.loaded
    rest, pressed = decoder_export.outputs_at(coder, np.array([[0, 0, 0], [0.2, 0.1, -0.5]]).T)
    loaded.set_up()
    drift = np.array([2e-3, -1e-3, 5e-4])
    off = (rest + drift).astype(np.float32)
    assert STATUSES[loaded.zero(ctypes.c_void_p(off.ctypes.data))] == "ok"
    assert_allclose(list(library("one", pressed + drift)[1].shift), [0.2, 0.1, -0.5], atol=1e-3)
    # a bad mean changes nothing, and a reading at a rail stays one after zeroing
    bad = np.array([np.nan, 0, 0], dtype=np.float32)
    assert STATUSES[loaded.zero(ctypes.c_void_p(bad.ctypes.data))] == "not_finite"
    assert_allclose(list(library("one", pressed + drift)[1].shift), [0.2, 0.1, -0.5], atol=1e-3)
    assert library("one", [np.float32(coder.forward.elements[0].high), *pressed[1:]])[0] == "saturated"
    loaded.set_up()
    for _ in range(25):
        word, answer = library("step", pressed, 0.01)
    assert word == "frozen"
    assert np.isnan(list(answer.force)).all()
    assert library("step", pressed + 2e-4, 0.01)[0] == "after_gap"


STAND_INS = {
    "Arduino.h": """
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
static const int A0 = 14, A1 = 15, A2 = 16;
static unsigned long ticks;
inline unsigned long micros() { return ticks += 10; }
inline void delay(int) {}
inline void analogReadResolution(int) {}
inline int analogRead(int) { return 1800; }
struct Port {
    explicit operator bool() const { return true; }
    void begin(long) {}
    int available() { return 0; }
    int read() { return -1; }
    void print(const char *s) { fputs(s, stdout); }
    void print(unsigned long n) { printf("%lu", n); }
    void print(float x, int digits = 2) { printf("%.*f", digits, double(x)); }
    template <class T> void println(T x) { print(x); puts(""); }
    void println() { puts(""); }
} static Serial;
""",
    "TLx493D_inc.hpp": """
struct TwoWire {} static Wire;
enum TLx493D_IICAddressType_t { TLx493D_IIC_ADDR_A0_e };
namespace ifx { namespace tlx493d {
struct TLx493D_A1B6 {
    TLx493D_A1B6(TwoWire &, TLx493D_IICAddressType_t) {}
    bool begin() { return true; }
    bool getMagneticField(double *x, double *y, double *z) { *x = *y = 0; *z = -20; return true; }
};
} }
""",
    "Adafruit_MLX90393.h": """
enum mlx90393_gain { MLX90393_GAIN_1X = 7 };
enum mlx90393_resolution { MLX90393_RES_19 = 3 };
enum mlx90393_axis { MLX90393_X, MLX90393_Y, MLX90393_Z };
enum mlx90393_filter { MLX90393_FILTER_2 = 2 };
enum mlx90393_oversampling { MLX90393_OSR_0 };
struct Adafruit_MLX90393 {
    bool begin_I2C(uint8_t) { return true; }
    bool setGain(mlx90393_gain) { return true; }
    bool setResolution(mlx90393_axis, mlx90393_resolution) { return true; }
    bool setOversampling(mlx90393_oversampling) { return true; }
    bool setFilter(mlx90393_filter) { return true; }
    bool readData(float *x, float *y, float *z) { *x = *y = 0; *z = -2e4f; return true; }
};
""",
}


def run_sketch(folder, name, *, run=True):
    """Compile a sketch with stand-ins for core and driver, run set-up and one loop, and return what it prints."""
    source = folder / "sketch.cpp"
    sketch = (folder / "examples" / name / f"{name}.ino").read_text()
    main_text = "\nint main() { setup(); loop(); return 0; }\n"
    source.write_text(f'#include "Arduino.h"\n{sketch}{main_text}')
    for file, text in STAND_INS.items():
        (folder / file).write_text(text)
    flags = ["-std=c++11", "-O0", "-Wall", "-Wextra", "-Werror", "-Wno-unused-variable", "-I.", "-Isrc"]
    subprocess.run(["g++", *flags, "sketch.cpp", "-o", "sketch", "-lm"], cwd=folder, check=True)
    return subprocess.run(["./sketch"], cwd=folder, check=True, capture_output=True, text=True).stdout if run else ""


@needs("g++")
def test_the_frame_of_a_sketch_for_other_chips_compiles_and_its_self_test_agrees(tmp_path):
    ready = decoder_export.prepare(
        Design(hall_layout="mlx90393", chip_count=2, chip_x=2.5, chip_noise=1e-5), Exporting(flash="20k")
    )
    for file, text in decoder_export.texts(ready, "magtip firmware").items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    assert "chip2_-z" in (tmp_path / "extras" / "test_vectors.csv").read_text()
    run_sketch(tmp_path, "OtherChip", run=False)
    assert run_sketch(tmp_path, "SelfTest").startswith("wrong statuses: 0,")


@needs("g++")
@pytest.mark.parametrize(
    ("layout", "name"), [("three", "AnalogElements"), ("tlv493d-a1b6", "TLx493D"), ("mlx90393", "MLX90393")]
)
def test_sketches_compile_and_the_self_test_agrees(firmware, chip, layout, name, tmp_path):
    if layout == "mlx90393":
        ready = decoder_export.prepare(Design(hall_layout=layout), Exporting(flash="16k"))
    else:
        ready = firmware if layout == "three" else chip
    for file, text in decoder_export.texts(ready, "magtip firmware").items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)
    assert "zero: " in run_sketch(tmp_path, name)
    if layout == "mlx90393":
        return
    printed = run_sketch(tmp_path, "SelfTest")
    assert printed.startswith("wrong statuses: 0,")
    differences = printed.replace(",", "").split()
    assert max(float(differences[5]), float(differences[7])) < 5e-3


def test_errors_are_those_of_the_required_loads_in_percent_of_their_press():
    needed = Requirements(force_z=6.0, force_x=0.5)
    plain, made = (decoder_export.prepare(Design(), Exporting(flash="16k"), needed=each) for each in (None, needed))
    assert plain.scale == (plain.errors[1], plain.errors[2], "the largest force of the workspace")
    error, full, words = made.scale
    assert (full, words, made.percent) == (6.0, "the required press", pytest.approx(100 * error / 6))
    assert 0 < error < made.errors[1]
    header = decoder_export.header(made, "magtip firmware")
    assert f"at most: {made.percent:.2g} % of\n * the required press (6 N)" in header
    # test vectors are rated loads, beside three bad readings: corners of the workspace may have a hundred times more
    for ready, (normal, aside) in ((plain, plain.rated), (made, (6.0, 0.5))):
        rows = [row for row in decoder_export.vectors(ready) if math.isnan(row["seconds"])][:-3]
        force = np.array([[row[f"force_{axis}_N"] for axis in "xyz"] for row in rows])
        assert len(rows) == 31
        assert 0.5 * normal < np.nanmax(force[:, 2]) <= normal * 1.001
        assert np.nanmax(np.hypot(*force[:, :2].T)) <= aside * 1.001


def test_verb(tmp_path, capsys):
    out = tmp_path / "library"
    assert main(["firmware", "paper", "--out", str(out), "--flash", "16k", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["flash_bytes"] <= 16384
    assert record["table_error_percent"] < 0.5
    assert sorted(p.relative_to(out).as_posix() for p in out.rglob("[!.]*") if p.is_file()) == sorted(
        [*decoder_export.PLAIN, "examples/AnalogElements/AnalogElements.ino", "examples/SelfTest/SelfTest.ino"]
    )
    header = (out / "src" / "magtip_decoder.h").read_text()
    assert record["digest"] in header
    assert "double" not in header
    assert max(len(line) for line in header.splitlines() if " Made with " not in line) <= 120
    vectors = (out / "extras" / "test_vectors.csv").read_text().splitlines()
    assert vectors[0].startswith("S1_V,S2_V,S3_V,seconds,status,shift_x_mm")
    assert {"ok", "saturated", "not_finite", "out_of_workspace", "after_gap"} <= {v.split(",")[4] for v in vectors}
    # its own files are written again, those of others are not
    assert main(["firmware", "paper", "--out", str(out), "--flash", "16k"]) == 0
    (out / "src" / "magtip_decoder.h").write_text("mine")
    capsys.readouterr()
    assert main(["firmware", "paper", "--out", str(out)]) == 2
    assert "magtip_decoder.h' was changed after magtip had written it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--flash", "9k"], "--flash 9k is too small: the smallest decoder of this design takes"),
        (["--flash", "nan"], "--flash takes a size"),
        (["--flash", "0"], "--flash takes a size"),
        (["--set", "magnet_diameter=0", "--set", "magnet_height=0"], "this design has no magnet"),
        (["--level", "none"], "level must be one of"),
        (["--set", "l0=4.5"], "lies inside the beam"),
        (["--calibration", "c.json", "--level", "finite"], "--calibration gives mechanics and sensor: leave --level"),
    ],
)
def test_bad_input_is_one_sentence(arguments, sentence, tmp_path, capsys):
    assert main(["firmware", "paper", "--out", str(tmp_path / "new"), *arguments]) == 2
    err = capsys.readouterr().err
    assert sentence in err
    # what is wrong by itself is said before any work
    assert "--flash takes" not in err or err.startswith("magtip:")
    assert not (tmp_path / "new").exists()
