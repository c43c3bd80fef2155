"""Boards of `magtip board` in KiCad: its design rule check, its Gerber and drill files beside ours, places of parts.

KiCad runs in the Python of the system, which has its module pcbnew; Gerber and drill files of both are read by
gerbonara. Pads, vias, tracks, silkscreen and outline must be the same shapes at the same places; the ground has an
area within a few per cent, for each program rounds its corners in another way. The schematic must have the nets of
the board; it is read by the places of its pins and labels.
"""

import io
import itertools
import json
import math
import shutil
import subprocess
import tempfile
import tomllib
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from geometry import base
from geometry.array_design import grid_array
from geometry.arrays import Point
from geometry.bad_input import BadInput
from geometry.cad import element_positions
from geometry.design import Design, preset
from geometry.fabrication.hall_elements import SS495A
from geometry.messages import Progress
from studies.fabrication import array_board, board_files, circuit_board
from studies.fabrication.board_layers import Board
from studies.fabrication.kicad_schematic import schematic
from studies.output.goals import Goal
from studies.output.result import Result
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("BOARD.md", "board.csv")
CASES: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("board_cases.toml").read_text("utf-8"))["board"]
SAME = 1e-3
"""Largest distance of places that are the same, mm: the step of KiCad's drill files."""
LARGEST_AREA = 3.0
"""Largest difference of the areas of the ground, percent."""


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Check boards of one beam and of arrays by KiCad; exit status 3 for a broken rule or another shape.

    Parameters
    ----------
    quick
        The first board only.
    """
    python = kicad_python()
    chosen = CASES[:1] if quick else CASES
    rows = [checked(case, python) for case in pages.told(progress, chosen, lambda case: str(case["name"]))]
    count = len(rows)
    goals = [
        Goal("findings of KiCad's design rule check", sum(row["findings"] for row in rows), 0, count),
        Goal(
            "findings after KiCad has filled the ground anew", sum(row["refilled_findings"] for row in rows), 0, count
        ),
        Goal("shapes that only one of two Gerber files has", sum(row["other_shapes"] for row in rows), 0, count),
        Goal("drilled holes that only one of two files has", sum(row["other_holes"] for row in rows), 0, count),
        Goal("largest distance of a Hall part from its place", max(row["off_um"] for row in rows), 1, count, "um"),
        Goal(
            "pins of the schematic on another net than on the board", sum(row["other_nets"] for row in rows), 0, count
        ),
        Goal(
            "largest difference of the ground's area",
            max(row["area_off_percent"] for row in rows),
            LARGEST_AREA,
            count,
            "%",
        ),
    ]
    page = {"rows": rows, "version": rows[0]["kicad"]}
    return pages.study("board", "Boards in KiCad", rows, page, goals=goals, packages=("gerbonara", "shapely"))


def kicad_python() -> str:
    """Return a Python that has KiCad's module; BadInput if there is none."""
    for python in dict.fromkeys(("/usr/bin/python3", shutil.which("python3") or "python3")):
        try:
            subprocess.run([python, "-c", "import pcbnew"], check=True, capture_output=True, timeout=60)
        except (OSError, subprocess.SubprocessError):
            continue
        return python
    raise BadInput(
        "no Python has KiCad's module pcbnew: install KiCad (Debian: apt-get install --no-install-recommends kicad)"
    )


def checked(case: dict[str, Any], python: str) -> Row:
    """Return what KiCad finds in the board of a case, and how its files differ from ours."""
    design = preset(case["design"], **case.get("fields", {}))
    choices, process, thickness = (
        base.Base(**case.get("base", {})),
        case.get("process", "fdm"),
        case.get("thickness", 1.6),
    )
    beams = [(0.0, 0.0)]
    if grid := case.get("array"):
        whole = base.array_plan(grid_array(design, *grid), choices, process)
        plan, made, beams = whole.one, array_board.board(whole, thickness), whole.array.places.tolist()
    else:
        plan = base.plan(design, choices, process)
        made = circuit_board.board(design, plan, thickness)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, board_files.BOARD)
        file.write_text(board_files.kicad_board(made, case["name"]), "utf-8")
        Path(folder, board_files.PROJECT).write_text(board_files.kicad_project(), "utf-8")
        script = Path(__file__).with_name("board_kicad.py")
        done = subprocess.run(
            [python, str(script), str(file), folder], check=True, capture_output=True, text=True, timeout=300
        )
        found = json.loads(done.stdout.splitlines()[-1])
        shapes, holes = differences(made, Path(folder))
    areas = zip(found["ground_mm2"], found["refilled_mm2"], strict=True)
    return {
        "board": case["name"],
        "kicad": found["version"],
        "parts": len(made.parts),
        "nets": len(made.nets),
        "findings": len(found["loaded"]),
        "refilled_findings": len(found["refilled"]),
        "other_shapes": shapes,
        "other_holes": holes,
        "other_nets": len(nets_of(made).items() ^ nets_in(schematic(made, case["name"])).items()),
        "off_um": 1e3 * max(off(design, beams, found["places"])),
        "area_off_percent": 100 * max(abs(ours / theirs - 1) for ours, theirs in areas),
        "said": "; ".join(sorted({*found["loaded"], *found["refilled"]})),
    }


def nets_of(made: Board) -> dict[tuple[str, str], str]:
    """Return the net of each pin of a board by the name of its part and its number, "" for an open one."""
    return {(part.reference, pad.number): pad.net for part in made.parts for pad in part.pads}


def nets_in(text: str) -> dict[tuple[str, str], str]:
    """Return the same of a schematic, read by its places: a pin of a symbol on the sheet ends in a label or a cross.

    A pin without either is left out, and a label without a pin has the name of its net alone.
    """
    from gerbonara.cad.kicad.sexp import parse_sexp

    def items(parent: Any, kind: str) -> list[Any]:
        return [item for item in parent if isinstance(item, list) and item[0] == kind]

    def place(item: Any) -> tuple[float, float]:
        x, y = items(item, "at")[0][1:3]
        return round(x, 3), round(y, 3)

    read = parse_sexp(text)
    pins = {
        symbol[1]: [
            (*place(pin), items(pin, "number")[0][1])
            for unit in items(symbol, "symbol")
            for pin in items(unit, "pin")
        ]
        for symbol in items(items(read, "lib_symbols")[0], "symbol")
    }
    ends = {place(label): label[1] for label in items(read, "global_label")}
    ends |= {place(cross): "" for cross in items(read, "no_connect")}
    found = {}
    for symbol in items(read, "symbol"):
        name, (x, y) = items(symbol, "lib_id")[0][1], place(symbol)
        for u, v, number in pins[name]:
            # y of a symbol points upwards, that of the sheet downwards
            if (end := (round(x + u, 3), round(y - v, 3))) in ends:
                found[name.split(":")[1], number] = ends.pop(end)
    return found | {("", net): net for net in ends.values()}


def off(design: Design, beams: Sequence[Point], places: dict[str, list[float]]) -> Iterator[float]:
    """Yield the distances of sensitive volumes on KiCad's board from their places below the beams, mm."""
    at = element_positions(design)
    if design.hall_layout != "three":
        u, v = design.chip.plate_at
        for k, ((p, q), (x, y, _)) in enumerate(itertools.product(beams, at[::3]), 1):
            a, b, _ = places[f"U{k}"]
            yield math.dist((a + u, b + v), (p + x, q + y))
        return
    # S2 and S3 stand on their leads, which are in the middle of the body; S1 lies, 2 mm before the bend of its leads
    behind = SS495A.thickness / 2 - SS495A.depth
    ahead = SS495A.height / 2 + 2.0
    for name, (x, y, _), (u, v) in (
        ("S1", at[0], (-ahead, SS495A.pitch)),
        ("S2", at[1], (behind, SS495A.pitch)),
        ("S3", at[2], (-SS495A.pitch, behind)),
    ):
        a, b, _ = places[name]
        yield math.dist((a, b), (x + u, y + v))


def differences(made: Board, folder: Path) -> tuple[int, int]:
    """Return how many shapes of the Gerber files, and how many holes, only KiCad's files or only ours have.

    The ground has no aperture, and its area is compared.
    """
    from gerbonara import ExcellonFile, GerberFile

    with zipfile.ZipFile(io.BytesIO(board_files.gerber_zip(board_files.layer_stack(made)))) as archive:
        ours = {name: archive.read(name).decode() for name in archive.namelist()}

    def alone(name: str, ending: str, reader: Any) -> int:
        """Compare a file of KiCad's with ours of this name."""
        (file,) = folder.glob(f"*-{name.replace('.', '_')}.{ending}")
        texts = file.read_text("utf-8"), ours[f"{board_files.NAME}-{name}.{ending}"]
        with warnings.catch_warnings():
            # the reader dislikes the order of commands in KiCad's drill files
            warnings.filterwarnings("ignore", ".*G90 header statement", SyntaxWarning)
            one, other = (reader.from_string(text).objects for text in texts)
        return unlike(
            *([shape_of(each) for each in objects if hasattr(each, "aperture")] for objects in (one, other))
        )

    layers = ("F.Cu", "B.Cu", "F.Mask", "B.Mask", "F.Paste", "B.Paste", "F.SilkS", "Edge.Cuts")
    shapes = sum(alone(name, "gbr", GerberFile) for name in layers)
    holes = sum(alone(name, "drl", ExcellonFile) for name in ("PTH", "NPTH"))
    return shapes, holes


def shape_of(each: Any) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Return kind, size and places of a flash, line or arc, mm; a line has no direction."""
    from gerbonara.utils import MM

    each, kind = each.converted(MM), type(each).__name__
    box = each.aperture.bounding_box(MM) if kind == "Flash" else None
    size = (each.aperture.equivalent_width(MM),) if box is None else tuple(b - a for a, b in zip(*box, strict=True))
    if kind == "Flash":
        return kind, size, (each.x, each.y)
    ends = sorted(((each.x1, each.y1), (each.x2, each.y2)))
    return kind, size, (*ends[0], *ends[1])


def unlike(one: list[Any], other: list[Any]) -> int:
    """Return how many shapes have no partner within `SAME` in the other list.

    >>> unlike([("Line", (0.2,), (0, 0, 1, 0))], [("Line", (0.2,), (0, 0, 1, 1e-4)), ("Flash", (1.0,), (0, 0))])
    1
    """
    left = list(other)
    alone = 0
    for kind, size, at in one:
        partner = next((each for each in left if each[0] == kind and near(size, each[1]) and near(at, each[2])), None)
        if partner is None:
            alone += 1
        else:
            left.remove(partner)
    return alone + len(left)


def near(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return len(one) == len(other) and all(abs(a - b) <= SAME for a, b in zip(one, other, strict=True))
