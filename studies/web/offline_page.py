"""The explorer's page as one HTML file without a server, for one design: what `magtip explore --export` writes.

The page is the server's: its scripts and styles are inlined as classic scripts, in their order, with
`offline_engine.js` in place of `live_engine.js`. The design is fixed; depth, shear and direction move between stops,
whose states are solved while the page is written. It keeps the answers of the live page to each of them, as gzip, and
computes nothing: a state sheared along x answers for all directions, in which its response is turned. A
Content-Security-Policy in the page forbids every request.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fem.accuracy import LEVELS, Accuracy
from fem.scene import Scene
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress
from studies.inputs import user_input
from studies.mechanics import stored_answers
from studies.mechanics.store import Store
from studies.output import atomic_files
from studies.output.page_templates import rendered
from studies.web import state_answers, state_exports, state_pictures
from studies.web.explorer_state import RATES, ExplorerState, Level, Request, components, explorer_fields
from studies.web.page_content import PAGE, as_json, explorer_page, packed, page_charts
from studies.web.panels import ANSWERED_PANELS, Memory

if TYPE_CHECKING:
    from fem.solution import Solution

LIVE = "page/live_engine.js"
LEVEL: Level = "standard"
"""Accuracy of the page's finite elements: that of the verbs."""
DEEPEST, FARTHEST = 0.375, 0.375
"""Largest depth and shear over D, less where the silicone on the axis ends before."""
DEPTHS, SHEARS, DIRECTIONS = 15, 6, 24
"""Stops of depth and shear above 0, about: their steps are round; and directions of a full turn."""
SECTORS = 12
"""Sectors of half a turn of the sensor in 3D: half of those of the live page, for the size of the file."""
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing is loaded from, or sent to, any address."""

Data = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Stops:
    """Depths and shears, mm, both from 0, and directions, degrees, at which the page has states."""

    depth: list[float]
    shear: list[float]
    direction: list[float]


def stops_of(design: Design, magnet: Magnet) -> Stops:
    """Return the stops of a design.

    >>> stops = stops_of(Design(), "rigid")
    >>> stops.depth[1], stops.depth[-1], stops.shear[1], stops.shear[-1], stops.direction[1]
    (0.2, 3.0, 0.5, 3.0, 15.0)
    """
    room = 0.9 * (design.L - (design.magnet_height if magnet == "rigid" else 0.0))

    def even(end: float, count: int) -> list[float]:
        step = float(f"{end / count:.1g}")
        return [round(step * k, 9) for k in range(int(end / step + 1e-9) + 1)]

    turns = [360.0 * k / DIRECTIONS for k in range(DIRECTIONS)]
    return Stops(even(min(DEEPEST * design.D, room), DEPTHS), even(FARTHEST * design.D, SHEARS), turns)


def write(
    design: Design, path: Path, store: Store, progress: Progress = lambda *_: None, *, of_array: bool = False
) -> Path:
    """Solve for the states of a design, some of which must be presses, and write its page; return its path.

    of_array : whether the page says that the design is that of the beams of an array, of which it shows one.


    Numbers with error estimates come from the store, and are kept there. Pictures show the deformed bodies, which it
    does not hold: those of kept states are solved for, without estimates.
    """
    magnet = magnet_of(design)
    stops = stops_of(design, magnet)
    states = answers(design, magnet, stops, LEVELS[LEVEL], store, progress)
    atomic_files.write_text(path, page(design, stops, states, store, of_array=of_array))
    return path


def magnet_of(design: Design) -> Magnet:
    """Return how the mechanics treat the magnet: as rigid, where there is one."""
    return "rigid" if design.shape.has_magnet else "ignored"


def answers(
    design: Design,
    magnet: Magnet,
    stops: Stops,
    accuracy: Accuracy,
    store: Store,
    progress: Progress = lambda *_: None,
) -> list[list[Data]]:
    """Return the answers of the live page to each depth and shear, in all directions."""

    def path(loads: list[Load]) -> list[Solution]:
        return stored_answers.with_bodies(Scene(design, tuple(loads), accuracy, magnet), store)

    presses = path([Load(depth) for depth in stops.depth])
    if sum(state.status in ANSWERED for state in presses) < 2:
        raise BadInput("no press of this design could be solved: the page needs its states")
    decoder, rows = state_answers.build_decoder(design), []
    for k, (depth, press) in enumerate(zip(stops.depth, presses, strict=False)):
        progress(sum(stops.depth[: k + 1]) / sum(stops.depth), f"finite elements at depth {depth:.3g} mm")
        shears = [Load(depth, shear, friction="stick") for shear in stops.shear[1:]]
        states = [press, *(path(shears) if shears and depth and press.status in ANSWERED else [])]
        turns = [stops.direction[:1], *[stops.direction] * len(shears)]
        row = [
            answer(design, magnet, state, some, decoder)
            if state.status in ANSWERED
            else {"error": f"{state.message or state.status}: this page has no state of this load"}
            for state, some in zip(states, turns, strict=False)
        ]
        rows.append(row + [row[-1] if "error" in row[-1] else {"error": BEYOND}] * (len(turns) - len(row)))
    return rows


BEYOND = "this page has no state of this load: take magtip explore for it"


def answer(
    design: Design, magnet: Magnet, solution: Solution, directions: list[float], decoder: Any
) -> dict[str, Any]:
    """Return pictures of a state that is sheared along x, and its numbers, texts and files in each direction."""
    numbers = []
    for direction in directions:
        turned = in_direction(solution, direction)
        load = turned.load
        state = ExplorerState(design, load, magnet, LEVEL)
        numbers.append(
            {
                "state": state_answers.numbers(state, turned, decoder),
                "commands": state_exports.commands(state),
                "state.csv": state_exports.of_solution("state.csv", state, turned).decode(),
            }
        )
    sensor = state_pictures.surface(solution, SECTORS)
    # the page makes the front of the back, and the cut face of the section
    sensor["parts"] = {name: part for name, part in sensor["parts"].items() if name in ("back", "magnet")}
    return {
        "section": state_pictures.section(design, solution, magnet),
        "sensor3d": sensor,
        "field_lines": state_pictures.field_lines(design, solution),
        "directions": numbers,
    }


def in_direction(solution: Solution, direction: float) -> Solution:
    """Return a solution sheared along x with load and response of the same shear in a direction, degrees."""
    response, (c, s) = solution.response, components(1.0, direction)
    x, y = components(solution.load.shear_x, direction)
    (fx, fy, fz), (ux, uy, uz) = response.force, response.shift
    turned = replace(
        response,
        force=(c * fx - s * fy, s * fx + c * fy, fz),
        shift=(c * ux - s * uy, s * ux + c * uy, uz),
        tilt=c * response.tilt,
        tilt_y=s * response.tilt,
    )
    return replace(solution, load=replace(solution.load, shear_x=x, shear_y=y), response=turned)


def page(design: Design, stops: Stops, states: list[list[Data]], store: Store, *, of_array: bool = False) -> str:
    """Return the page of a design whose states are solved."""
    magnet = magnet_of(design)
    curve = state_answers.curve(design, magnet, LEVEL, store)
    content: Data = {
        "fields": _fields(design, stops),
        "stops": {"depth": stops.depth, "shear": stops.shear, "direction": stops.direction},
        "states": states,
        "curve": {"figures": curve["figures"]},
        "charts": page_charts(),
        "panels": _panels(design, magnet, store),
        "files": {
            "design.toml": user_input.design_text(design),
            "curve.csv": state_exports.of_curve(curve).decode(),
        },
    }
    known = sum("error" not in one for row in states for one in row[1:])
    sensor = state_exports.sensor_name(design)
    counts = {"presses": len(states) - 1, "sheared": known, "of_array": of_array}
    about = rendered(PAGE / "fixed_design.html.j2", sensor=sensor, level=LEVEL, stops=stops, **counts)
    text = explorer_page(offline=True)
    text = text.replace("<head>", f'<head>\n<meta http-equiv="Content-Security-Policy" content="{POLICY}">', 1)
    text = text.replace("<body>", '<body class="offline">', 1)
    text = text.replace('<p id="notice"', f'{about}\n<p id="notice"', 1)
    text = text.replace("Reset to the paper's sensor", "Reset the load")
    text = re.sub(r'<link rel="stylesheet" href="([^"]+)">', lambda link: _style(link[1]), text)
    return re.sub(r'<script src="([^"]+)"></script>', lambda script: _scripts(script[1], content), text)


def _panels(design: Design, magnet: Magnet, store: Store) -> Data:
    """Return the last answers of the panels that the page has, by their names."""
    panels = [panel for panel in ANSWERED_PANELS if panel.offline]
    state = ExplorerState(design, Load(0.0), magnet, LEVEL)
    request, memory = Request(0, "a", state, tuple(panel.name for panel in panels)), Memory(store)
    return {panel.name: [data for _, data in panel.answers(request, LEVEL, memory)][-1] for panel in panels}


def _fields(design: Design, stops: Stops) -> list[Data]:
    ends = {
        "depth": stops.depth,
        "shear": [-stops.shear[-1], *stops.shear],
        "direction": [-180.0, *(180.0 - turn for turn in stops.direction)],
    }
    first = state_exports.first_depth(design)
    fields = []
    for field in explorer_fields(design):
        name = field["name"]
        # the states are those at rest
        if name in RATES:
            continue
        if name in ends:
            low, high = min(ends[name]), max(ends[name])
            step = abs(ends[name][-1] - ends[name][-2])
            field |= {"low": low, "high": high, "slider": [low, high], "step": step, "stops": True}
        if name == "depth":
            field["value"] = min(stops.depth[1:], key=lambda depth: abs(depth - first))
        if name == "magnet":
            field["value"] = magnet_of(design)
        fields.append(field | {"fixed": name not in ends})
    return fields


def compressed(content: Mapping[str, Any]) -> str:
    """Return a content as gzip in base64; equal arrays stand in it once, with 16 bits for a number."""
    places: dict[str, int] = {}

    def placed(array: Any) -> dict[str, int]:
        return {"array": places.setdefault(json.dumps(_short(array)), len(places))}

    rest = as_json(content, placed)
    text = f'{{"arrays":[{",".join(places)}],{rest[1:]}'
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode("ascii")


def _short(array: Any) -> dict[str, Any]:
    if array.dtype.kind in "iu":
        return packed(array)
    scale = float(np.abs(array).max(initial=0.0)) / 32767 or 1.0
    numbers = np.round(array / scale).astype("<i2")
    return {"int16": base64.b64encode(numbers.tobytes()).decode("ascii"), "scale": scale}


def _style(name: str) -> str:
    return f"<style>\n{(PAGE.parent / name).read_text(encoding='utf-8')}\n</style>"


def _scripts(name: str, content: Mapping[str, Any]) -> str:
    """Return a script of the page inline; for the live engine, the data and the engine that replaces it."""
    if name != LIVE:
        return _script((PAGE.parent / name).read_text(encoding="utf-8"))
    data = f'window.MAGTIP_OFFLINE = "{compressed(content)}";'
    return f"{_script(data)}\n{_script((PAGE / 'offline_engine.js').read_text(encoding='utf-8'))}"


def _script(text: str) -> str:
    """Return a script as an element; in its strings, "<" of what HTML would read is written as an escape."""
    safe = re.sub(r"<(?=/script|!--|script)", r"\\x3c", text, flags=re.IGNORECASE)
    return f"<script>\n{safe}\n</script>"
