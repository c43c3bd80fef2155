"""Frames of readings in a stream of bytes: where each begins and ends, and which flux densities or voltages it holds.

| layout | one frame | unit |
|---|---|---|
| `lines` | a line of the elements' numbers, or x, y, z of each chip, between commas, tabs or blanks | of an option |
| `lines-xyzt` | a line with x, y, z and the temperature of each chip | uT |
| `anyskin` | per chip four little-endian float32, the temperature, x, y and z, then CR LF | uT |
| `aa` | 0xAA, then per chip three big-endian uint16, x, y and z, all bits inverted | counts |

No layout has a checksum of its own; a line may end in `*` and the exclusive or of all bytes before it as two
hexadecimal digits (as in NMEA 0183), and after `SUMS` lines that do, others are damaged. Without one, a frame
counts only if both of its ends are where they must be:

- a line, and a frame of `anyskin`, begins behind the end of another one. CR LF may occur in its data, so a frame with
  a byte more or less is dropped together with what follows up to the next pair of ends at the right distance;
- a frame of `aa` has 0xAA at its beginning and at that of the next one, so it counts when the next one begins, or
  when nothing follows for `IDLE`.

A byte that is changed within a number is seen here only by a temperature or a flux density that cannot be; the checks
of rows over time (`analytic.time_series.RowChecks`) see the jump.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from geometry.design import BadInput
from studies.inputs.table_input import COLDEST, HOTTEST

Layout = Literal["lines", "lines-xyzt", "anyskin", "aa"]
LINE, CRLF, BEGIN = b"\n", b"\r\n", b"\xaa"
IDLE = 0.02
"""Time without a byte, s, after which a frame of `aa` is taken for complete."""
LONGEST = 4096
"""Most bytes that are kept of a stream without any frame."""
MOST_CHIPS = 64
"""Most chips in a frame."""
MOST_TESLA = 1.0
"""Flux density, T, that no chip measures."""
LSB = (0.150, 0.242)
"""Flux density of a count of `aa`, uT, along x and y, and along z: an MLX90393 at gain 7, finest step."""
SUMS = 3
HALF_TURN, TURN = 2**15, 2**16
NUMBERS = re.compile(rb"[,;\s]+")


@dataclass(slots=True)
class Frames:
    """Cuts a stream of bytes into frames.

    Parameters
    ----------
    layout, width : layout of a frame, and its number of chips, or of numbers for `lines`.
    lsb : see `LSB`.
    needed : what a frame holds, in words.

    Attributes
    ----------
    skipped : number of bytes that belong to no frame.
    places : of the frames that the last `feed` has returned, counted from 0 with those that were dropped.
    """

    layout: Layout
    width: int
    lsb: tuple[float, float] = LSB
    needed: str = ""
    skipped: int = 0
    places: list[float] = field(default_factory=list)
    _fed: int = 0
    _seen_lines: int = 0
    _damage: str = ""
    _damaged_lines: int = 0
    _rest: bytearray = field(default_factory=bytearray)
    _follows: bool = False
    _right_sums: int = 0
    _last: list[int] = field(default_factory=list)

    @property
    def length(self) -> int:
        """Number of bytes of a frame; 0 for lines, which have any."""
        return {"anyskin": 16 * self.width + 2, "aa": 6 * self.width + 1}.get(self.layout, 0)

    @property
    def is_begun(self) -> bool:
        """Whether a frame has come whose end only the next one, or a silence, shows."""
        return self.layout == "aa" and bool(self._rest)

    def feed(self, data: bytes, *, idle: bool = False) -> list[tuple[float, ...]]:
        """Return the numbers of each frame that these bytes complete: those of a line, or x, y, z of each chip, uT,
        and behind them the temperatures of all chips, C, where a frame has them.

        idle : whether nothing has come for `IDLE`.
        """
        self._rest += data
        self._fed += len(data)
        self.places = []
        cut = self._lines if not self.length else self._ended if self.layout == "anyskin" else self._begun
        found = []
        for numbers in cut(idle):
            found.append(numbers)
            self.places.append(
                (self._fed - len(self._rest)) / self.length - 1 if self.length else self._seen_lines - 1
            )
        if len(self._rest) > LONGEST:
            self._skip(len(self._rest) - LONGEST // 2)
        return found

    @property
    def misfit(self) -> str:
        """Return why no frame was found, in words."""
        if self.length:
            return f"{self._fed} bytes came, and a frame has {self.length}: {self.needed}"
        return (
            self._damage or f"{self._seen_lines} lines came, of which the first only shows where the next one begins"
        )

    def _skip(self, count: int) -> None:
        """Drop bytes that belong to no frame."""
        if count:
            self.skipped += count
            self._follows = False
            del self._rest[:count]

    @property
    def lost(self) -> int:
        """Number of frames that were dropped: that of the skipped bytes, or of lines that are none."""
        return math.ceil(self.skipped / self.length) if self.length else self._damaged_lines

    def _lines(self, idle: bool) -> Iterator[tuple[float, ...]]:
        while (end := self._rest.find(LINE)) >= 0:
            line, begun = bytes(self._rest[:end]).strip(), self._follows
            del self._rest[: end + 1]
            self._follows = True
            self._seen_lines += bool(line)
            numbers = self._numbers(line) if line else ()
            if numbers and begun:
                yield numbers
            elif numbers is None or numbers:
                self._damaged_lines += 1
                self.skipped += end + 1

    def _numbers(self, line: bytes) -> tuple[float, ...] | None:
        """Return the numbers of a line; None if it is damaged."""
        content, star, digits = line.partition(b"*")
        if star:
            total = 0
            for byte in content:
                total ^= byte
            if digits.lower() != b"%02x" % total:
                return self._damaged("a line had a wrong checksum")
            self._right_sums += 1
        elif self._right_sums >= SUMS:
            return self._damaged("a line had no checksum, as those before it")
        try:
            numbers = [float(word) for word in NUMBERS.split(content.strip())]
        except ValueError:
            return self._damaged(f"a line was {line.decode('ascii', 'replace')!r:.60}, which are no numbers alone")
        count = self.width if self.layout == "lines" else 4 * self.width
        if len(numbers) != count:
            return self._damaged(f"a line had {len(numbers)} numbers, and {count} are needed: {self.needed}")
        if self.layout == "lines":
            return tuple(numbers)
        chips = [numbers[k : k + 4] for k in range(0, len(numbers), 4)]
        if not all(_can_be(t, xyz) for *xyz, t in chips):
            return self._damaged(f"a line was {line.decode('ascii', 'replace')!r:.60}, which no chip can have sent")
        return (*(value for *xyz, _ in chips for value in xyz), *(t for *_, t in chips))

    def _damaged(self, why: str) -> tuple[float, ...] | None:
        """Keep why the last damaged line is none, and return None."""
        self._damage = why
        return None

    def _ended(self, idle: bool) -> Iterator[tuple[float, ...]]:
        size = self.length
        while len(self._rest) >= size:
            if not self._follows:
                # the end of a frame, and another one at the right distance from it
                end = self._rest.find(CRLF)
                if end < 0:
                    self._skip(len(self._rest) - 1)
                    return
                self._skip(end)
                if len(self._rest) < size + 2:
                    return
                if self._rest[size : size + 2] != CRLF:
                    self._skip(1)
                    continue
                del self._rest[:2]
                self.skipped += 2
                self._follows = True
            if self._rest[size - 2 : size] != CRLF:
                self._skip(1)
                continue
            numbers = struct.unpack(f"<{4 * self.width}f", self._rest[: size - 2])
            chips = [numbers[k : k + 4] for k in range(0, len(numbers), 4)]
            del self._rest[:size]
            if all(_can_be(t, xyz) for t, *xyz in chips):
                yield (*(value for _, *xyz in chips for value in xyz), *(t for t, *_ in chips))
            else:
                self.skipped += size

    def _begun(self, idle: bool) -> Iterator[tuple[float, ...]]:
        size = self.length
        while len(self._rest) >= size:
            begin = self._rest.find(BEGIN)
            self._skip(len(self._rest) if begin < 0 else begin)
            # the next frame, and the one after it if it is there; behind a damaged one it must be
            ends = [size, 2 * size]
            if any(self._rest[end : end + 1] not in (b"", BEGIN) for end in ends):
                self._skip(1)
                continue
            complete = len(self._rest) > (size if self._follows else 2 * size)
            if not (complete or (idle and self._follows and len(self._rest) == size)):
                return
            counts = [TURN - 1 - count for count in struct.unpack(f">{3 * self.width}H", self._rest[1:size])]
            del self._rest[:size]
            self._follows = True
            yield self._unwrapped(counts)

    def begin_near(self, field: Sequence[float]) -> None:
        """Take counts of the first frame for those nearest to a field, uT: x, y, z of each chip."""
        self._last = [round(value / self.lsb[k % 3 == 2]) for k, value in enumerate(field)]

    def _unwrapped(self, counts: Sequence[int]) -> tuple[float, ...]:
        """Return flux densities, uT, from counts that begin again at 2^16: the nearest to those of the last frame."""
        last = self._last or [0] * len(counts)
        self._last = [b + (c - b + HALF_TURN) % TURN - HALF_TURN for b, c in zip(last, counts, strict=True)]
        return tuple(count * self.lsb[k % 3 == 2] for k, count in enumerate(self._last))


def _can_be(temperature: float, xyz: Iterable[float]) -> bool:
    """Return whether a chip can have sent a temperature, C, and flux densities, uT."""
    return COLDEST < temperature < HOTTEST and all(abs(value) < 1e6 * MOST_TESLA for value in xyz)


def mounting(text: str) -> list[tuple[int, float]]:
    """Return which axis of a chip, with which sign, lies along x, y and z of the sensor.

    >>> mounting("y,-x,z")
    [(1, 1.0), (0, -1.0), (2, 1.0)]

    Raises
    ------
    BadInput
        The text does not name each axis once, or the axes make a left-handed frame.
    """
    words = [word.strip().lstrip("+") for word in text.split(",")]
    axes = [word.lstrip("-") for word in words]
    signs = [-1.0 if word.startswith("-") else 1.0 for word in words]
    if sorted(axes) != ["x", "y", "z"]:
        raise BadInput(f"--axes names the chip's axis along x, y and z of the sensor, such as y,-x,z; got {text!r}")
    order = ["xyz".index(axis) for axis in axes]
    inversions = sum(order[i] > order[j] for i in range(3) for j in range(i + 1, 3))
    if math.prod(signs) * (-1) ** inversions < 0:
        raise BadInput(f"--axes {text} mirrors the chip: no chip can be mounted so; change the sign of one axis")
    return list(zip(order, signs, strict=True))
