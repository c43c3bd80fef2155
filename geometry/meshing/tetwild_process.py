"""A program that runs fTetWild with a fixed seed: `python tetwild_process.py INPUT.npz OUTPUT.npz`.

fTetWild inserts the facets in an order that it shuffles with a generator seeded by std::random_device. This is the
only reason why two meshes of one shape differ; threads, addresses and the state of Python have no effect. Neither
fTetWild nor pytetwild has an option for the seed. So this program replaces the library's reference to
std::random_device with a function that returns SEED. The replacement needs the ELF tables of 64-bit Linux. On other
platforms, and with a library that was built differently, fTetWild runs without a fixed seed, and `seeded` in
OUTPUT.npz is false.

fTetWild crashes or hangs on bad input; therefore it runs in a separate process. This file is run by its path and
imports nothing of the project.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

SEED = 1
"""Value of every draw from std::random_device. Any fixed number serves; another number gives another mesh."""
RANDOM = b"_ZNSt13random_device9_M_getvalEv"
"""Name in libstdc++ of the function behind std::random_device::operator()."""

NULL, SIZE_OF_CALLS, STRINGS, SYMBOLS, CALLS, FLAGS, EXTRA_FLAGS = 0, 2, 5, 6, 23, 30, 0x6FFFFFFB
"""Tags of a dynamic section: DT_NULL, DT_PLTRELSZ, DT_STRTAB, DT_SYMTAB, DT_JMPREL, DT_FLAGS, DT_FLAGS_1."""
NOW, NOW_1 = 8, 1
"""Bits DF_BIND_NOW and DF_1_NOW of the flags: with either of them the table of calls is read-only."""
SYMBOL_BYTES = 24
"""Size of one entry of the symbol table (Elf64_Sym)."""

Draw = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_void_p)


class Library(ctypes.Structure):
    """First fields of struct link_map, to which the handle of dlopen points."""

    _fields_ = (("base", ctypes.c_size_t), ("name", ctypes.c_char_p), ("dynamic", ctypes.c_size_t))


class Entry(ctypes.Structure):
    """One entry of a dynamic section (Elf64_Dyn)."""

    _fields_ = (("tag", ctypes.c_int64), ("value", ctypes.c_size_t))


class Call(ctypes.Structure):
    """One reference to a function of another library (Elf64_Rela)."""

    _fields_ = (("offset", ctypes.c_size_t), ("info", ctypes.c_uint64), ("addend", ctypes.c_int64))


def slot(path: str, function: bytes) -> int | None:
    """Return the address of the pointer through which a library calls a function; None if it cannot be replaced."""
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
        # glibc stores absolute addresses in the loaded table, musl stores them relative to the base
        return table[tag] if table[tag] >= library.base else table[tag] + library.base

    for k in range(table[SIZE_OF_CALLS] // ctypes.sizeof(Call)):
        call = Call.from_address(absolute(CALLS) + k * ctypes.sizeof(Call))
        symbol = absolute(SYMBOLS) + (call.info >> 32) * SYMBOL_BYTES
        name = absolute(STRINGS) + ctypes.c_uint32.from_address(symbol).value
        if ctypes.string_at(name) == function:
            return int(library.base + call.offset)
    return None


def main(input_file: Path, output_file: Path) -> None:
    """Mesh the surface in the input file and write points, cells and `seeded` to the output file."""
    # this module of pytetwild adds a method to PyVista's surfaces; to import PyVista takes longer than a small mesh
    sys.modules.setdefault("pytetwild._accessor", ModuleType("pytetwild._accessor"))
    import pytetwild
    from pytetwild import PyfTetWildWrapper

    drawn: list[int] = []

    def draw(_: Any) -> int:
        drawn.append(SEED)
        return SEED

    constant = Draw(draw)  # a name keeps the callback alive while the library may call it
    if sys.platform == "linux" and sys.maxsize > 2**32:
        place = slot(str(PyfTetWildWrapper.__file__), RANDOM)
        if place is not None:
            ctypes.c_size_t.from_address(place).value = ctypes.cast(constant, ctypes.c_void_p).value or 0
    with np.load(input_file) as request:
        points, cells = pytetwild.tetrahedralize(
            request["points"],
            request["faces"],
            edge_length_abs=float(request["size"]),
            epsilon=float(request["epsilon"]),
            num_threads=1,
            num_opt_iter=int(request["passes"]),
            disable_filtering=bool(request["around"]),
            vtk_ordering=True,
            quiet=True,
            bg_vertices=request["grid"],
            bg_tets=request["tets"],
            bg_values=request["values"],
        )
    np.savez(output_file, points=points, cells=cells, seeded=bool(drawn))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
