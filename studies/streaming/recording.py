"""Records of a stream for ROS 2: MCAP files with geometry_msgs/WrenchStamped and sensor_msgs/MagneticField.

The wrench is what acts on the tip, in the sensor's frame (z along the beam, away from the base): a press of F newtons
has the force z = -F. Torques are not measured: NaN. Flux densities are in T, of each 3-axis chip or one-axis element
on a topic of its own, NaN along axes that it does not measure; a covariance of zeros means unknown, as ROS has it.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from analytic import parts
from analytic.decode import field_of
from geometry.design import BadInput, Design
from studies.output import atomic_files
from studies.streaming.sources import Decoded, Sink

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
STATUS = "string data"
"""Definitions of the messages, as ROS 2 states them."""


@contextlib.contextmanager
def mcap_file(path: Path, design: Design, frame_id: str) -> Iterator[Sink]:
    """Yield a sink that writes an MCAP file, which appears under its name when the stream ends.

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
    elements = parts.of_design(design)
    groups = grouped(elements)
    with atomic_files.atomic(path) as temporary, temporary.open("wb") as file, Writer(file) as writer:
        wrench, field, word = (
            writer.register_msgdef(name, text)
            for name, text in (
                ("geometry_msgs/msg/WrenchStamped", WRENCH),
                ("sensor_msgs/msg/MagneticField", FIELD),
                ("std_msgs/msg/String", STATUS),
            )
        )
        begun, last = time.time_ns(), ""

        def write(rows: Sequence[Decoded]) -> None:
            nonlocal last
            for row in rows:
                now = begun + round(1e9 * row["time_s"])
                head = {"stamp": {"sec": now // 10**9, "nanosec": now % 10**9}, "frame_id": frame_id}

                def send(topic: str, schema: Any, message: Any, now: int = now) -> None:
                    writer.write_message(topic, schema, message, log_time=now, publish_time=now)

                x, y, z = (row[f"force_{axis}_N"] for axis in "xyz")
                unknown = dict.fromkeys("xyz", math.nan)
                send("wrench", wrench, {"header": head, "wrench": {"force": {"x": x, "y": y, "z": -z},
                                                                   "torque": unknown}})  # fmt: skip
                readings = [row[f"{name}_{elements[0].unit}"] for name in parts.columns(elements)]
                tesla = field_of(elements, [readings])[0].tolist()
                for name, members in groups.items():
                    along = dict(unknown)
                    for k in members:
                        for axis, n in zip("xyz", elements[k].direction, strict=True):
                            if n:
                                along[axis] = n * tesla[k]
                    message = {"header": head, "magnetic_field": along, "magnetic_field_covariance": [0.0] * 9}
                    send(f"magnetic_field/{name}", field, message)
                if row["status"] != last:
                    send("status", word, {"data": row["status"]})
                    last = row["status"]

        yield write


def grouped(elements: Sequence[parts.Element]) -> dict[str, list[int]]:
    """Return the numbers of the elements by their chip, or by their own names.

    >>> grouped(parts.of_design(Design(hall_layout="tmag5273a1"))), grouped(parts.of_design(Design()))
    ({'chip': [0, 1, 2]}, {'S1': [0], 'S2': [1], 'S3': [2]})
    """
    groups: dict[str, list[int]] = {}
    for k, element in enumerate(elements):
        groups.setdefault(element.name.partition(" ")[0], []).append(k)
    return groups
