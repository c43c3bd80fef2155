"""The process in which fTetWild runs, with a fixed seed: `python tetwild_process.py GIVEN.npz FOUND.npz`.

fTetWild inserts the facets in an order that it shuffles with a generator seeded by std::random_device. That alone
makes two of its meshes of one shape differ; threads, addresses and the state of Python do not. Neither fTetWild nor
pytetwild has an option for the seed. So the library's own reference to std::random_device is replaced in this
process: it calls a function that returns SEED. This needs the tables of ELF, as on Linux with 64 bits. Elsewhere, and
with a library that is built another way, fTetWild runs as it is, and `seeded` in FOUND.npz is false.

The process is one of its own because fTetWild crashes or hangs on bad input. It imports nothing of the project.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytetwild
from pytetwild import PyfTetWildWrapper

SEED = 1
RANDOM = b"_ZNSt13random_device9_M_getvalEv"
"""What libstdc++ calls the function behind std::random_device::operator()."""

NULL, SIZE_OF_CALLS, STRINGS, SYMBOLS, CALLS, FLAGS, EXTRA_FLAGS = 0, 2, 5, 6, 23, 30, 0x6FFFFFFB
"""Tags of a dynamic section: DT_NULL, DT_PLTRELSZ, DT_STRTAB, DT_SYMTAB, DT_JMPREL, DT_FLAGS, DT_FLAGS_1."""
NOW, NOW_1 = 8, 1
"""Bits DF_BIND_NOW and DF_1_NOW of the flags: with them the table of calls cannot be written."""
SYMBOL_BYTES = 24

Draw = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_void_p)


class Library(ctypes.Structure):
    """First fields of what dlopen returns (struct link_map)."""

    _fields_ = (("base", ctypes.c_size_t), ("name", ctypes.c_char_p), ("dynamic", ctypes.c_size_t))


class Entry(ctypes.Structure):
    """One of a dynamic section (Elf64_Dyn)."""

    _fields_ = (("tag", ctypes.c_int64), ("value", ctypes.c_size_t))


class Call(ctypes.Structure):
    """One reference to a function of another library (Elf64_Rela)."""

    _fields_ = (("offset", ctypes.c_size_t), ("info", ctypes.c_uint64), ("addend", ctypes.c_int64))


def slot(path: str, function: bytes) -> int | None:
    """Address of the pointer through which a loaded library calls a function; None if it has none to write to."""
    library = Library.from_address(ctypes.CDLL(path)._handle)
    table: dict[int, int] = {}
    place = library.dynamic
    while (entry := Entry.from_address(place)).tag != NULL:
        table[entry.tag] = entry.value
        place += ctypes.sizeof(Entry)
    if not {STRINGS, SYMBOLS, CALLS, SIZE_OF_CALLS} <= table.keys():
        return None
    if table.get(FLAGS, 0) & NOW or table.get(EXTRA_FLAGS, 0) & NOW_1:
        return None

    def absolute(tag: int) -> int:
        # glibc has added the base already, musl has not
        return table[tag] if table[tag] >= library.base else table[tag] + library.base

    for k in range(table[SIZE_OF_CALLS] // ctypes.sizeof(Call)):
        call = Call.from_address(absolute(CALLS) + k * ctypes.sizeof(Call))
        symbol = absolute(SYMBOLS) + (call.info >> 32) * SYMBOL_BYTES
        name = absolute(STRINGS) + ctypes.c_uint32.from_address(symbol).value
        if ctypes.string_at(name) == function:
            return int(library.base + call.offset)
    return None


def main(given: Path, found: Path) -> None:
    """Mesh what one file holds, into the other."""
    drawn: list[int] = []

    def draw(_: Any) -> int:
        drawn.append(SEED)
        return SEED

    constant = Draw(draw)
    if sys.platform == "linux" and sys.maxsize > 2**32:
        place = slot(str(PyfTetWildWrapper.__file__), RANDOM)
        if place is not None:
            ctypes.c_size_t.from_address(place).value = ctypes.cast(constant, ctypes.c_void_p).value or 0
    with np.load(given) as wanted:
        points, cells = pytetwild.tetrahedralize(
            wanted["points"],
            wanted["faces"],
            edge_length_abs=float(wanted["size"]),
            epsilon=float(wanted["epsilon"]),
            num_threads=1,
            num_opt_iter=int(wanted["passes"]),
            disable_filtering=bool(wanted["around"]),
            vtk_ordering=True,
            quiet=True,
            bg_vertices=wanted["grid"],
            bg_tets=wanted["tets"],
            bg_values=wanted["values"],
        )
    np.savez(found, points=points, cells=cells, seeded=bool(drawn))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
