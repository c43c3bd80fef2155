"""Readings that arrive: frames, what is decoded from them, their records, their page, and bad input."""

import contextlib
import csv
import functools
import importlib
import itertools
import json
import math
import os
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import threading
import tty
import xml.etree.ElementTree
from pathlib import Path

import numpy as np
import pytest
from browser import opened, said, wait
from numpy.testing import assert_allclose

import studies
from analytic.decode import field_of
from analytic.inverse import forward_model
from analytic.parts import of_design
from analytic.stream import Stream
from geometry.design import BadInput, Design, paper
from studies.cli import commands
from studies.inputs.option_groups import SourceOfLoad
from studies.sensing import decode_readings
from studies.simulation import mechanics_sources
from studies.streaming import clocks, frames, live_stream, ros2_package

RECORDING = Path(studies.__file__).parent / "examples" / "recording.csv"
CHIPS = 2


def chips(k):
    """Flux densities of two chips, uT, in the k-th frame; each number is in one frame only."""
    return [float(np.float32(10 * k + n + 0.25)) for n in range(3 * CHIPS)]


def with_sum(text):
    total = 0
    for byte in text.encode():
        total ^= byte
    return f"{text}*{total:02X}\r\n".encode()


def sent(layout, k):
    values = chips(k)
    if layout == "anyskin":
        return b"".join(struct.pack("<4f", 25.0, *values[n : n + 3]) for n in (0, 3)) + b"\r\n"
    if layout == "aa":
        return b"\xaa" + b"".join(struct.pack(">H", 0xFFFF - round(v)) for v in values)
    if layout == "lines-xyzt":
        return "\t".join(f"{x}\t{y}\t{z}\t25.0" for x, y, z in (values[:3], values[3:])).encode() + b"\n"
    return with_sum(",".join(map(str, values)))


def expected(layout, k):
    return [round(v) for v in chips(k)] if layout == "aa" else chips(k)


def fed(layout, data, pieces):
    reader = frames.Frames(layout, 3 * CHIPS if layout == "lines" else CHIPS, (1.0, 1.0))
    found = []
    while data:
        count = pieces.randrange(1, 90)
        found += reader.feed(data[:count])
        data = data[count:]
    return found + reader.feed(b"", idle=True), reader


@pytest.mark.parametrize("layout", ["lines", "lines-xyzt", "anyskin", "aa"])
def test_frames_are_found_in_any_pieces(layout):
    found, reader = fed(layout, b"".join(sent(layout, k) for k in range(200)), random.Random(1))
    # what comes first may be the end of a frame
    first = 0 if layout == "aa" else 1
    assert [list(row[: 3 * CHIPS]) for row in found] == [expected(layout, k) for k in range(first, 200)]
    warm = [25.0] * CHIPS if layout in ("lines-xyzt", "anyskin") else []
    assert [list(row[3 * CHIPS :]) for row in found] == [warm] * len(found)
    assert reader.lost <= 1


@pytest.mark.parametrize("layout", ["lines", "anyskin", "aa"])
def test_cut_doubled_and_foreign_bytes_give_no_wrong_frame(layout):
    """Every frame that is found was sent; at most three are lost for a fault."""
    chance, stream, faults = random.Random(2), b"", 0
    for k in range(2000):
        frame, fault = sent(layout, k), chance.random()
        at = chance.randrange(1, len(frame))
        if fault < 0.02:
            frame = frame[:at]
        elif fault < 0.04:
            frame = frame[:at] + frame[at - 1 : at] + frame[at:]
        elif fault < 0.05:
            frame += chance.randbytes(at)
        elif fault < 0.06:
            frame = b""
        faults += fault < 0.06
        stream += frame
    found, reader = fed(layout, stream, chance)
    known = [expected(layout, k) for k in range(2000)]
    wrong = [row for row in (list(row[: 3 * CHIPS]) for row in found) if row not in known]
    # 0xAA may also stand where a cut frame of this layout would end: once in 256
    assert len(wrong) <= (faults // 64 if layout == "aa" else 0)
    assert 2000 - 3 * faults < len(found) < 2000
    assert reader.lost > 0


def test_counts_begin_near_the_field_at_rest():
    """A chip under the magnet sees 20 mT, four times what 16 bits of 0.15 uT hold."""
    design = Design(hall_layout="tmag5273a1", chip_x=1.0)
    options = live_stream.Streaming(port="-", frames="aa", axes="y,-x,z")
    rest = live_stream.rest_in_frames(design, options, 1)
    assert max(map(abs, rest)) > 0.15 * 2**16
    counts = [round(v / frames.LSB[k == 2]) & 0xFFFF for k, v in enumerate(rest)]
    reader = frames.Frames("aa", 1)
    reader.begin_near(rest)
    frame = b"\xaa" + struct.pack(">3H", *(0xFFFF - c for c in counts))
    found = reader.feed(3 * frame)[0]
    assert found == pytest.approx(rest, abs=0.2)
    x, y, _ = live_stream.reader(design, options)(found)
    field = forward_model.readings_at(forward_model.model(design), np.zeros((3, 1)))[:, 0]
    assert (x, y) == pytest.approx(field[:2], abs=2e-7)


def test_a_checksum_is_needed_once_lines_have_it():
    reader = frames.Frames("lines", 2)
    good = [with_sum(f"{k},1") for k in range(6)]
    assert reader.feed(b"\n1,2\n5*zz\n" + b"".join(good[:3])) == [(1.0, 2.0), (0.0, 1.0), (1.0, 1.0), (2.0, 1.0)]
    assert reader.feed(b"3,1\n" + good[4].replace(b"4", b"7") + good[5]) == [(5.0, 1.0)]


def streamed(capsys, *options):
    status = commands.run(["stream", "paper", *map(str, options), "--json"])
    return status, [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_replay_is_the_decoding_of_its_file(capsys, tmp_path):
    status, rows = streamed(capsys, "--port", RECORDING, "--speed", 0, "--level", "finite")
    assert status == 0
    commands.run(["decode", "paper", "--file", str(RECORDING), "--level", "finite", "--json"])
    slow = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["status"] for row in rows] == [row["status"] for row in slow]
    for name in ("force_x_N", "force_z_N", "shift_z_mm"):
        assert_allclose([row[name] for row in rows], [row[name] for row in slow], atol=1e-6)


def test_serial_port_is_decoded_until_it_closes(capsys, tmp_path):
    """Frames of a chip that is mounted a quarter turn about z, the second one of a frame."""
    design = Design(hall_layout="tmag5273a1")
    forward = forward_model.model(design, forward_model.NO_TILT)
    shift = np.zeros((3, 60))
    shift[:, 40:] = np.array([[0.3], [0.1], [-0.5]])
    field = forward_model.readings_with_slopes(forward, shift + 1e-6 * np.arange(60))[0]
    x, y, z = 1e6 * field[1], 1e6 * field[2], -1e6 * field[0]
    ours, port = os.openpty()
    tty.setraw(port)
    found = []

    def listen():
        found.append(
            commands.run(
                [
                    # frames come at once, so that their times are not known: no force may depend on them
                    *("stream", "paper", "--set", "hall_layout=tmag5273a1", "--set", "loss_factor=0"),
                    *("--port", os.ttyname(port), "--level", "paper"),
                    *("--frames", "anyskin", "--frame-chips", "2", "--chips", "2", "--axes", "y,-x,z"),
                    *("--out", str(tmp_path / "rows.csv")),
                ]
            )
        )

    thread = threading.Thread(target=listen)
    thread.start()
    wait_for(lambda: is_open(os.ttyname(port)))
    os.write(ours, b"\r\n")
    for k in range(60):
        # along the chip's own axes: x of the sensor is its y, y of the sensor its -x
        os.write(ours, struct.pack("<8f", 20, 1, 2, 3, 20, -y[k], x[k], z[k]) + b"\r\n")
    wait_for(lambda: lines_of(tmp_path / "rows.csv.part") >= 60)
    os.close(port)
    os.close(ours)
    thread.join(20)
    assert found == [0]
    rows = list(csv.DictReader((tmp_path / "rows.csv").open()))
    assert [row["status"] for row in rows[:40]] == ["ok"] * 40
    assert_allclose([float(rows[-1][f"shift_{axis}_mm"]) for axis in "xyz"], [0.3, 0.1, -0.5], atol=1e-4)


def is_open(name):
    """Whether another file of this process is the terminal; files that close meanwhile are none."""
    found = 0
    for number in os.listdir("/proc/self/fd"):
        with contextlib.suppress(FileNotFoundError):
            found += os.readlink(f"/proc/self/fd/{number}") == name
    return found > 1


def lines_of(file):
    return len(file.read_text().splitlines()) - 1 if file.exists() else 0


def wait_for(condition):
    event = threading.Event()
    for _ in range(1000):
        if condition():
            return
        event.wait(0.02)
    pytest.fail("nothing came")


# Times


def timed(stamps, unit="ms", *, arrivals=None):
    """Times that a device's clock gives to rows with these stamps."""
    clock = clocks.DeviceClock(unit)
    found = [clock.rows([(stamp, k)], 0.0 if arrivals is None else arrivals[k]) for k, stamp in enumerate(stamps)]
    rows = [*itertools.chain(*found), *clock.rest()]
    assert [numbers[0] for _, numbers in rows] == list(range(len(stamps)))
    return np.array([time for time, _ in rows]), clock


@pytest.mark.parametrize(("unit", "second"), [("s", 1), ("ms", 1e3), ("us", 1e6)])
def test_stamps_are_times_in_their_unit(unit, second):
    times, _ = timed(0.02 * second * np.arange(50) + 7, unit)
    assert_allclose(times, 0.02 * np.arange(50), atol=1e-9)


@pytest.mark.parametrize("row", [0, 1, 2, 30, 59])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, -5, 0, 3, 305, 9000, 1e30])
def test_a_damaged_stamp_spoils_its_own_row_only(bad, row):
    stamps = 100.0 + 10 * np.arange(60)
    stamps[row] = bad
    times, clock = timed(stamps)
    assert np.flatnonzero(np.isnan(times)).tolist() == [row]
    # since the first row that has a time
    assert_allclose(np.delete(times, row), np.delete(0.01 * (np.arange(60) - (row == 0)), row), atol=1e-9)
    assert clock.remarks == []


def test_microseconds_begin_again_after_71_minutes():
    stamps = (2**32 - 500_000 + 10_000 * np.arange(100)) % 2**32
    assert_allclose(timed(stamps, "us")[0], 0.01 * np.arange(100), atol=1e-9)


def test_missing_rows_and_a_device_that_begins_again_go_on():
    gap = 10.0 * np.r_[0:20, 50:70]
    assert_allclose(timed(gap)[0], 1e-3 * gap, atol=1e-9)
    again = np.concatenate([5e4 + 10.0 * np.arange(20), 10.0 * np.arange(20)])
    arrivals = np.concatenate([0.01 * np.arange(20), 3 + 0.01 * np.arange(20)])
    times, clock = timed(again, arrivals=arrivals)
    assert_allclose(times, arrivals, atol=1e-9)
    assert "the device's clock began again once" in clock.remarks[0]


def test_one_damaged_stamp_does_not_change_the_forces_behind(capsys, tmp_path):
    """Its own row has no time; a clock that took it had 7.42 N for 11.42 N in all rows behind."""
    lines = [f"{50 * k},2.871,2.793,2.793" for k in range(12)] + [
        f"{600 + 50 * k},2.967,2.850,2.850" for k in range(12)
    ]
    good, bad = tmp_path / "good.txt", tmp_path / "bad.txt"
    good.write_text("\n".join([*lines, ""]))
    bad.write_text("\n".join([*lines[:8], "99999999,2.871,2.793,2.793", *lines[9:], ""]))
    options = ("--clock", "ms", "--level", "finite", "--speed", 0)
    (_, right), (_, found) = (streamed(capsys, "--port", file, *options) for file in (good, bad))
    assert [row["status"] for row in found[7:9]] == ["untimed", "after_gap"]
    assert found[7]["time_s"] is None
    assert right[11]["force_z_N"] > 1.2 * right[22]["force_z_N"]
    assert_allclose([row["force_z_N"] for row in found], [row["force_z_N"] for row in right])


def test_rows_by_their_arrival_have_a_time_only_where_they_arrive_as_they_are_measured():
    clock = clocks.Arrival()
    # a recording that is there already
    assert np.isnan([time for time, _ in clock.rows([(1.0,)] * 300, 1.0) + clock.rows([(1.0,)] * 300, 1.1)]).all()
    # rows that come one by one, and some late ones together
    for k in range(5):
        clock.waits(2 + 0.01 * k)
        assert clock.rows([(1.0,)], 2.005 + 0.01 * k)[0][0] == pytest.approx(0.01 * k)
    clock.waits(2.05)
    late = clock.rows([(1.0,)] * 4, 2.085)
    assert_allclose([time for time, _ in late], [0.05, 0.06, 0.07, 0.08])
    # a source that has not been empty for long is read too late
    assert math.isnan(clock.rows([(1.0,)], 2.6)[0][0])
    clock.waits(2.65)
    assert clock.rows([(1.0,)], 2.66)[0][0] == pytest.approx(0.655)
    # and one that is poured in behind them
    clock.waits(2.69)
    assert np.isnan([time for time, _ in clock.rows([(1.0,)] * 300, 2.695)]).all()
    assert np.isnan([time for time, _ in clock.rows([(1.0,)] * 3, 2.8)]).all()


def test_a_pipe_without_times_has_forces_of_slow_loading_and_says_so(tmp_path):
    """Each row had the time 0, as if all had been pressed within no time: 25 N for 9 N."""
    with RECORDING.open() as file:
        lines = "\n".join(line.rstrip().partition(",")[2] for line in file)
    words = [
        "stream",
        "paper",
        "--level",
        "finite",
        "--port",
        "-",
        "--zero",
        "0",
        "--out",
        str(tmp_path / "rows.csv"),
    ]
    found = subprocess.run(
        [sys.executable, "-m", "studies.cli", *words], input=lines, capture_output=True, text=True, timeout=60
    )
    assert found.returncode == 0, found.stderr
    assert "10 of 10 rows untimed: the time is not known" in found.stderr.replace("\n", " ")
    rows = list(csv.DictReader((tmp_path / "rows.csv").open()))
    assert {row["time_s"] for row in rows} == {""}
    slow = Stream(
        decode_readings.prepare(paper(), mechanics_sources.source_of(paper(), SourceOfLoad(level="finite")))
    )
    field = field_of(of_design(paper()), [[float(rows[-1][f"S{k}_V"]) for k in (1, 2, 3)]])[0]
    assert float(rows[-1]["force_z_N"]) == pytest.approx(slow.step(tuple(field)).force[2])


# Frames of files, and chips in lines


def test_frames_of_a_file_are_replayed_with_their_rate(capsys, tmp_path):
    """The first line only shows where the next one begins; frames that are damaged take their time, too."""
    with RECORDING.open() as file:
        lines = [line.rstrip().partition(",")[2] for line in file][1:]
    (tmp_path / "capture.txt").write_text("\n".join([*lines[:3], "2.8", *lines[4:], ""]))
    options = ("--port", tmp_path / "capture.txt", "--rate", 20, "--speed", 0, "--level", "finite")
    status, rows = streamed(capsys, *options)
    assert status == 0
    assert_allclose([row["time_s"] for row in rows], np.delete(0.05 * np.arange(10), 2))


def test_a_file_of_frames_without_their_rate_is_told_so(refusal, tmp_path):
    (tmp_path / "capture.txt").write_text(f"{LINE}\n{LINE}\n")
    sentence = refusal("stream", "paper", "--port", tmp_path / "capture.txt")
    assert "begins with numbers in place of heads: a file of frames needs their --rate, or --clock" in sentence


def test_lines_of_a_chips_own_axes_need_no_other_order(capsys, tmp_path):
    design = Design(hall_layout="tmag5273a1")
    down, x, y = 1e6 * forward_model.readings_at(forward_model.model(design), np.array([[0.1], [0.2], [-0.4]]))[:, 0]
    text = "".join(f"7,7,7,{-y:.3f},{x:.3f},{-down:.3f}\n" for _ in range(3))
    (tmp_path / "capture.txt").write_text(text)
    chip = ("--set", "hall_layout=tmag5273a1", "--units", "uT", "--axes", "y,-x,z", "--frame-chips", 2, "--chips", 2)
    status, rows = streamed(
        capsys, "--level", "paper", "--port", tmp_path / "capture.txt", "--rate", 9, "--speed", 0, *chip
    )
    assert status == 0
    assert_allclose([rows[0][f"shift_{axis}_mm"] for axis in "xyz"], [0.1, 0.2, -0.4], atol=1e-2)


@pytest.mark.parametrize(
    ("content", "options", "sentence"),
    [
        (b"1,2,3,4\n1,2,3,4\n", [], "a line had 4 numbers, and 3 are needed: S1, S2, S3"),
        (b"1,2,3\n1,2,3\n", ["--clock", "ms"],
         "a line had 3 numbers, and 4 are needed: the device's time, S1, S2, S3"),
        (b"# head\nx,y,z\n", [], "a line was 'x,y,z', which are no numbers alone"),
        (b"1,2\n3,4\n", ["--axes", "x,y,z", "--set", "hall_layout=tmag5273a1"],
         "a line had 2 numbers, and 3 are needed: x, y and z of 1 chip"),
        (b"abc", ["--frames", "anyskin", "--set", "hall_layout=tmag5273a1"],
         "3 bytes came, and a frame has 18: temperature, x, y and z of 1 chip"),
    ],
)  # fmt: skip
def test_what_was_no_frame_is_told_with_what_is_needed(content, options, sentence, run, tmp_path):
    (tmp_path / "capture").write_bytes(content)
    more = [] if "--clock" in options else ["--rate", "9"]
    status, _, err = run("stream", "paper", "--port", tmp_path / "capture", "--speed", "0", *more, *options)
    assert status == 3
    assert f"no frame was understood ({sentence})" in err.replace("\n", " ")


def test_a_zero_needs_a_number_of_each_element():
    live = live_stream.Live(paper(), live_stream.Streaming(port="-", rest=0.2))
    with pytest.raises(BadInput, match="an element sent no number"):
        live.rows([(0.1 * k, (2.87, float("nan"), 2.79)) for k in range(4)])
    # one that is asked for later waits for the numbers, and loses no row
    live = live_stream.Live(paper(), live_stream.Streaming(port="-"))
    live.zero_asked = True
    (row,) = live.rows([(0.0, (2.87, float("nan"), 2.79))])
    assert (row["status"], live.zero_asked) == ("not_finite", True)
    assert "no zero was taken since it was asked for" in live.remarks[-1]
    # nor is one taken of rows whose times are not known
    live.rows([(math.nan, (2.87, 2.79, 2.79))])
    assert live.zero_asked
    live.rows([(1.0, (2.87, 2.79, 2.79))])
    assert not live.zero_asked


def test_a_zero_beyond_the_end_is_said(run):
    status, _, err = run("stream", "paper", "--port", RECORDING, "--speed", "0", "--zero", "9")
    assert status == 3
    assert "the stream ended before --zero 9 s" in err


def topics_of(file):
    """Times and messages of each topic of a record, read by another library."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    messages = {}
    with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, moment, raw in reader.messages():
            messages.setdefault(connection.topic, []).append((moment, reader.deserialize(raw, connection.msgtype)))
    return messages


def test_record_is_read_by_another_library(capsys, tmp_path):
    """Forces act on the tip: a press points along -z; axes without an element, and torques, are NaN."""
    file = tmp_path / "press.mcap"
    _, rows = streamed(capsys, "--port", RECORDING, "--speed", 0, "--level", "finite", "--mcap", file)
    messages = topics_of(file)
    wrench = [message.wrench for _, message in messages["wrench"]]
    assert_allclose([w.force.z for w in wrench], [-row["force_z_N"] for row in rows])
    assert np.isnan([w.torque.x for w in wrench]).all()
    assert messages["wrench"][0][1].header.frame_id == "magtip_tip"
    _, s2 = messages["magnetic_field/S2"][-1]
    assert np.isnan([s2.magnetic_field.y, s2.magnetic_field.z]).all()
    assert s2.magnetic_field.x == pytest.approx((rows[-1]["S2_V"] - 2.5) / 31.25)
    assert not s2.magnetic_field_covariance.any()
    assert [message.data for _, message in messages["status"]] == ["ok", "uncalibrated", "ok"]
    assert messages["wrench"][-1][0] - messages["wrench"][0][0] == pytest.approx(0.5e9)


def test_a_record_of_a_table_has_its_zero(run, strict, tmp_path):
    """With --zero the forces of --mcap are those of the table: both take the same rows for rest."""
    file, zero = tmp_path / "press.mcap", ("--file", RECORDING, "--level", "finite", "--zero", "0.06")
    status, out, _ = run("decode", "paper", *zero, "--mcap", file, "--json")
    assert status == 0
    rows, plain = strict(out), strict(run("decode", "paper", *zero[:-2], "--json")[1])
    forces = [message.wrench.force.z for _, message in topics_of(file)["wrench"]]
    assert_allclose(forces, [-row["force_z_N"] for row in rows], atol=1e-9)
    assert abs(rows[-1]["force_z_N"] - plain[-1]["force_z_N"]) > 1e-3


def test_page_shows_forces_and_takes_a_zero(chromium, tmp_path):
    """The last row of a replay that goes on: a press, which a zero makes the rest."""
    with RECORDING.open() as file:
        *_, pressed = csv.reader(file)
    file = tmp_path / "rows.csv"
    rows = [f"{0.02 * k}," + ",".join(pressed[1:]) for k in range(5000)]
    file.write_text("\n".join(["time_s,S1_V,S2_V,S3_V", *rows]))
    words = ["stream", "paper", "--port", str(file), "--level", "finite", "--page", "--no-browser"]
    process = subprocess.Popen([sys.executable, "-m", "studies.cli", *words], stdout=subprocess.PIPE, text=True)
    try:
        page = opened(chromium, process.stdout.readline().strip())
        cell = "document.querySelector('#measured-panel tr:last-child td').textContent"
        wait(page, f"!document.querySelector('#measured-panel').hidden && parseFloat({cell}) > 2")
        assert "rows per second; 0 frames lost" in page.inner_text("#measured-panel .state")
        page.evaluate("document.querySelector('#measured-panel button').click()")
        wait(page, f"Math.abs(parseFloat({cell})) < 0.01")
        assert [text for text in said(page) if "GPU stall" not in text] == []
        page.close()
        process.send_signal(signal.SIGINT)
        text, _ = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "rows" in text


# A recording is not lost with its process


LINE = "2.967,2.876,2.851"


def streaming(folder, *options, **more):
    words = ["stream", "paper", "--level", "finite", "--port", "-", "--out", str(folder / "rows.csv"), *options]
    return subprocess.Popen(
        [sys.executable, "-m", "studies.cli", *words],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more,
    )  # fmt: skip


def messages_of(file):
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader

    found = []
    with file.open("rb") as stream, contextlib.suppress(McapError, struct.error):
        # a file that is not complete ends without its mark, or within a record
        found.extend(1 for record in StreamReader(stream).records if type(record).__name__ == "Message")
    return len(found)


def test_a_killed_stream_leaves_its_rows_and_the_next_one_ends_whole_without_its_terminal(tmp_path):
    parts = tmp_path / "rows.csv.part", tmp_path / "rows.mcap.part", tmp_path / "rows.csv.part1"
    killed = streaming(tmp_path, "--mcap", str(tmp_path / "rows.mcap"))
    killed.stdin.write(f"{LINE}\n" * 200)
    killed.stdin.flush()
    wait_for(lambda: lines_of(parts[0]) == 199 and messages_of(parts[1]) > 500)
    killed.kill()
    killed.communicate()
    assert messages_of(parts[1]) > 500
    after = streaming(tmp_path)
    after.stdin.write(f"{LINE}\n" * 9)
    after.stdin.flush()
    wait_for(lambda: lines_of(parts[2]) == 8)
    after.send_signal(signal.SIGHUP)
    _, err = after.communicate(timeout=20)
    assert after.returncode == 0
    assert "rows.csv.part, what a stream that was killed has left, stays" in err.replace("\n", " ")
    assert [lines_of(parts[0]), lines_of(tmp_path / "rows.csv"), parts[2].exists()] == [199, 8, False]


def test_a_full_disk_leaves_the_rows_so_far_and_names_them(tmp_path):
    limit = functools.partial(resource.setrlimit, resource.RLIMIT_FSIZE, (4096, 4096))
    full = streaming(tmp_path, preexec_fn=limit)
    _, err = full.communicate(f"{LINE}\n" * 100, timeout=60)
    assert full.returncode == 2, err
    assert f"the rows so far are in '{tmp_path / 'rows.csv.part'}'" in err.replace("\n", " ")
    assert "File too large" in err
    assert lines_of(tmp_path / "rows.csv.part") > 10


def test_the_rows_of_a_file_stay_when_their_reader_goes(tmp_path, monkeypatch):
    """As behind a pipe into `head -1`."""
    read, write = os.pipe()
    os.close(read)
    monkeypatch.setattr(sys, "stdout", os.fdopen(write, "w"))
    words = [
        "stream",
        "paper",
        "--port",
        str(RECORDING),
        "--speed",
        "0",
        "--json",
        "--out",
        str(tmp_path / "rows.csv"),
    ]
    assert commands.run(words) == commands.BROKEN_PIPE
    assert lines_of(tmp_path / "rows.csv") == 11


def test_a_row_without_a_time_is_recorded_without_a_stamp(capsys, tmp_path):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    stamps = [*range(0, 80, 10), "nan", *range(90, 120, 10)]
    (tmp_path / "capture").write_text("".join(f"{stamp},{LINE}\n" for stamp in stamps))
    file = tmp_path / "rows.mcap"
    options = ("--port", tmp_path / "capture", "--clock", "ms", "--speed", 0, "--level", "finite", "--mcap", file)
    assert streamed(capsys, *options)[0] == 0
    with AnyReader([file], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        (connection,) = (each for each in reader.connections if each.topic == "wrench")
        heads = [
            reader.deserialize(raw, connection.msgtype).header
            for _, _, raw in reader.messages(connections=[connection])
        ]
    assert [head.stamp.sec == 0 for head in heads] == [k == 7 for k in range(11)]


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The ROS 2 package that firmware writes for the paper's sensor, importable."""
    assert commands.run(["firmware", "paper", "--out", str(tmp_path / "o"), "--flash", "16k", "--ros2"]) == 0
    folder = tmp_path / "o" / "ros2" / "magtip_sensor"
    monkeypatch.syspath_prepend(folder)
    return folder


def test_ros_package_is_whole_and_its_feed_is_the_stream(package, capsys, tmp_path):
    """The node itself needs ROS: its files are compiled, and what it publishes comes from the feed."""
    for file in package.rglob("*.py"):
        compile(file.read_text("utf-8"), file, "exec")
    assert xml.etree.ElementTree.parse(package / "package.xml").getroot().get("format") == "3"
    named = re.findall(r'"((?:resource|launch|config)/[\w./]*)"', (package / "setup.py").read_text("utf-8"))
    assert len(named) == 4
    assert "reject_ambient: false" in (package / "config" / "sensor.yaml").read_text("utf-8")
    rejecting = ros2_package.files(Design(), reject_ambient=True)["ros2/magtip_sensor/config/sensor.yaml"]
    rejecting(tmp_path / "sensor.yaml")
    assert "reject_ambient: true" in (tmp_path / "sensor.yaml").read_text("utf-8")
    assert all((package / name).exists() for name in named)
    feed = importlib.import_module("magtip_sensor.feed").Feed
    capsys.readouterr()
    _, rows = streamed(capsys, "--port", RECORDING, "--speed", 0, "--level", "finite")
    messages = list(feed(str(RECORDING), str(package / "config" / "design.toml"), "tip", level="finite"))
    pushed = [fields["wrench"]["force"]["z"] for topic, _, fields in messages if topic == "wrench"]
    assert_allclose(pushed, [-row["force_z_N"] for row in rows])
    assert {topic for topic, _, _ in messages} == {"wrench", "status", *(f"magnetic_field/S{k}" for k in (1, 2, 3))}
    # rows that are poured into a pipe have no times
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    thread = threading.Thread(target=pipe.write_text, args=(f"{LINE}\n" * 9,))
    thread.start()
    assert sum(topic == "wrench" for topic, _, _ in feed(str(pipe), "paper", "tip", level="finite")) == 8
    thread.join()
    slower = feed(str(RECORDING), "paper", "tip", level="finite", rate=10.0)
    assert sum(topic == "wrench" for topic, _, _ in slower) == 6


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--port", "/dev/none"], "there is no port '/dev/none'"),
        (["--port", "-", "--frames", "anyskin"], "frames of anyskin hold the axes of 3-axis chips"),
        (["--port", "-", "--units", "mT"], "--units mT is no unit of these elements: choose one of V, mV"),
        (["--port", RECORDING, "--speed", "-1"], "--speed must be 0 (no waiting) or more; got -1"),
        (["--port", RECORDING, "--frames", "aa", "--set", "hall_layout=tmag5273a1"],
         "--frames has no meaning for a table"),
        (["--port", "-", "--axes", "x,y,-z", *(chip := ["--frames", "aa", "--set", "hall_layout=tmag5273a1"])],
         "mirrors the chip"),
        (["--port", "-", "--axes", "x,x,z", *chip], "--axes names the chip's axis along x, y and z"),
        (["--port", "-", "--chips", "1,2", *chip], "--chips names the 1 chips of the frame"),
        (["--port", "-", "--clock", "ms", *chip], "--clock has no meaning for frames of aa"),
        (["--port", RECORDING, "--units", "mV"], "a file of frames also needs their --rate, or --clock"),
        (["--port", RECORDING, "--clock", "ms", "--rate", "100"], "--rate has no meaning for frames of lines"),
        (["--port", RECORDING, "--rate", "0"], "--rate must be a number of Hz above 0; got 0"),
        (["--port", "-", "--axes", "x,y,z"], "lines with --axes x,y,z hold the axes of 3-axis chips"),
        (["--port", "-", "--frame-chips", "1000000000", *chip], "a frame has 1 to 64 chips; got 1000000000"),
        (["--port", "-", "--frame-chips", "0", *chip], "a frame has 1 to 64 chips; got 0"),
        (["--port", "-", "--chips", "99", *chip], "a frame has 1 to 64 chips; got 99"),
        (["--port", RECORDING, "--zero", "-1"], "--zero must be a time of 0 s or more; got -1"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(options, sentence, capsys):
    assert commands.run(["stream", "paper", *map(str, options)]) == 2
    out, err = capsys.readouterr()
    assert sentence in err
    assert out == ""
    assert err.count("\n") == 1
