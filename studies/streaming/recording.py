"""Records of a stream for ROS 2: MCAP files with geometry_msgs/WrenchStamped and sensor_msgs/MagneticField.

The wrench is what acts on the tip, in the sensor's frame (z along the beam, away from the base): a press of F newtons
has the force z = -F. Torques are not measured: NaN. Flux densities are in T, of each 3-axis chip or one-axis element
on a topic of its own, NaN along axes that it does not measure; a covariance of zeros means unknown, as ROS has it.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from analytic import parts
from analytic.decode import field_of
from geometry.array_design import ArrayDesign
from geometry.design import BadInput, Design
from studies.output import atomic_files, console, own_files
from studies.streaming.sources import Decoded, Sink

CHUNK = 16_384
"""Bytes that an MCAP file gathers before it writes them: what a killed process loses."""
FRAME = "magtip_tip"
"""Frame of the messages where none is given."""
HEADER = """std_msgs/Header header
{fields}
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
VECTOR = """================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
WRENCH = (
    HEADER.format(fields="geometry_msgs/Wrench wrench")
    + """================================================================================
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
"""
    + VECTOR
)
FIELD = HEADER.format(fields="geometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance") + VECTOR
TYPES = {
    "geometry_msgs/msg/WrenchStamped": WRENCH,
    "sensor_msgs/msg/MagneticField": FIELD,
    "std_msgs/msg/String": "string data",
}
"""Definitions of the messages, as ROS 2 states them."""


class NothingDecoded(Exception):
    """A stream has ended without a row: no file of heads alone is left."""


@contextlib.contextmanager
def growing(path: Path) -> Iterator[Path]:
    """Yield a path beside another one, NAME.part, whose file gets its name at the end; after an error it stays.

    What is recorded cannot be had again: also a process that is killed leaves its part, and the next one another.
    """
    names = (path.with_name(f"{path.name}.part{k or ''}") for k in itertools.count())
    part = next(name for name in names if not os.path.lexists(name))
    if part.suffix != ".part":
        console.warn(f"{path.name}.part, what a stream that was killed has left, stays")
    try:
        with atomic_files.with_file_name(path):
            yield part
            own_files.note(path.parent, {path.name: part})
            os.replace(part, path)
    except NothingDecoded:
        part.unlink(missing_ok=True)
        raise
    except BaseException:
        if part.exists():
            console.warn(f"the rows so far are in {str(part)!r}")
        raise


@contextlib.contextmanager
def mcap_file(path: Path, design: Design | ArrayDesign, frame_id: str) -> Iterator[Sink]:
    """Yield a sink that writes an MCAP file.

    Topics: wrench, magnetic_field/NAME for each chip or element, and status (std_msgs/String) when it changes.

    Raises
    ------
    BadInput
        The packages that write it are not installed.
    """
    try:
        from mcap_ros2.writer import Writer
    except ImportError:
        raise BadInput("--mcap needs two packages: pip install 'magtip[record]'") from None
    messages = Messages(design, frame_id)
    with path.open("wb") as file, Writer(file, chunk_size=CHUNK) as writer:
        schemas = {name: writer.register_msgdef(name, text) for name, text in TYPES.items()}

        def write(rows: Sequence[Decoded]) -> None:
            for row in rows:
                now = messages.moment(row)
                for topic, kind, fields in messages.of_row(row):
                    writer.write_message(topic, schemas[kind], fields, log_time=now, publish_time=now)
            file.flush()

        yield write


class Messages:
    """Messages of ROS 2 for decoded rows, as their fields; times begin with the clock of the first one."""

    def __init__(self, design: Design | ArrayDesign, frame_id: str) -> None:
        self._elements = parts.of_design(design)
        self._groups, self._frame = grouped(self._elements), frame_id
        self._begun, self._status = time.time_ns(), ""
        self._last = self._begun

    def moment(self, row: Decoded) -> int:
        """Return the time of a row, ns since 1970; that of the row before where it is not known."""
        if not math.isnan(row["time_s"]):
            self._last = self._begun + round(1e9 * float(row["time_s"]))
        return self._last

    def of_row(self, row: Decoded) -> Iterator[tuple[str, str, dict[str, Any]]]:
        """Yield topic, type and fields of the messages of a row: wrench, magnetic fields, status if it changed."""
        now, elements = self.moment(row), self._elements
        # a stamp of 0 is a time that is not known
        seconds, nanoseconds = (0, 0) if math.isnan(row["time_s"]) else divmod(now, 10**9)
        head = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": self._frame}
        x, y, z = (row[f"force_{axis}_N"] for axis in "xyz")
        unknown = dict.fromkeys("xyz", math.nan)
        wrench = {"force": {"x": x, "y": y, "z": -z}, "torque": unknown}
        yield "wrench", "geometry_msgs/msg/WrenchStamped", {"header": head, "wrench": wrench}
        readings = [row[f"{name}_{elements[0].unit}"] for name in parts.columns(elements)]
        tesla = field_of(elements, [readings])[0].tolist()
        for name, members in self._groups.items():
            along = dict(unknown)
            for k in members:
                for axis, n in zip("xyz", elements[k].direction, strict=True):
                    if n:
                        along[axis] = n * tesla[k]
            fields = {"header": head, "magnetic_field": along, "magnetic_field_covariance": [0.0] * 9}
            yield f"magnetic_field/{name}", "sensor_msgs/msg/MagneticField", fields
        if row["status"] != self._status:
            self._status = row["status"]
            yield "status", "std_msgs/msg/String", {"data": self._status}


def grouped(elements: Sequence[parts.Element]) -> dict[str, list[int]]:
    """Return the numbers of the elements by their chip, or by their own names.

    >>> grouped(parts.of_design(Design(hall_layout="tmag5273a1"))), grouped(parts.of_design(Design()))
    ({'chip': [0, 1, 2]}, {'S1': [0], 'S2': [1], 'S3': [2]})
    """
    groups: dict[str, list[int]] = {}
    for k, element in enumerate(elements):
        groups.setdefault(element.name.partition(" ")[0], []).append(k)
    return groups
