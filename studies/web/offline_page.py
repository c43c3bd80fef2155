"""The explorer's page as one HTML file without a server, for one design: what `magtip explore --export` writes.

The page is the server's: its scripts and styles are inlined as classic scripts, in their order, with
`offline_engine.js` in place of `live_engine.js`. The design is fixed; depth, shear and direction move between states
that are solved while the page is written (`offline_tables`), and all numbers are computed then. A
Content-Security-Policy in the page forbids every request.
"""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analytic import beam
from fem.accuracy import LEVELS
from geometry.design import Design
from geometry.loads import Magnet
from geometry.messages import Progress
from studies.inputs import user_input
from studies.output import atomic_files
from studies.output.page_templates import rendered
from studies.web import offline_tables, state_answers, state_exports, state_pictures
from studies.web.explorer_state import RATES, Level, explorer_fields
from studies.web.offline_tables import Grid
from studies.web.page_content import as_json

PAGE = Path(__file__).parent / "page"
"""Files of the page."""
INDEX, LIVE = "index.html", "page/live_engine.js"
LEVEL: Level = "standard"
"""Accuracy of the page's finite elements: that of the verbs."""
SOLVING = 0.75
"""Share of the time that the finite elements take."""
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing is loaded from, or sent to, any address."""
STYLE = "#about-model { padding: 6px 16px; font-size: 13px } #about-model p { margin: 4px 0 0 }"
HIDDEN = (
    'label:has(#view-level), [data-export="mold.zip"], [data-export="fields.vtu"], #vibration-panel, #loop-panel, '
    "#margins-panel { display: none }"
)
"""Controls and panels that need a server."""
MOVED = ("depth", "shear", "direction")
"""Fields that move on the page; every other one is fixed."""

Data = dict[str, Any]


def write(design: Design, path: Path, progress: Progress | None = None) -> Path:
    """Solve for the states of a design and write its page; return its path.

    Raises
    ------
    BadInput
        No press of the design could be solved.
    """

    def solving(share: float, text: str) -> None:
        if progress is not None:
            progress(SOLVING * share, text)

    magnet = magnet_of(design)
    grid = offline_tables.solve(design, magnet, LEVELS[LEVEL], solving)
    if progress is not None:
        progress(SOLVING, "readings, formulas, curve and stability")
    atomic_files.write_text(path, page(grid, magnet))
    return path


def magnet_of(design: Design) -> Magnet:
    """Return how the mechanics treat the magnet: as rigid, where there is one."""
    return "rigid" if design.shape.has_magnet else "ignored"


def page(grid: Grid, magnet: Magnet) -> str:
    """Return the page of a design whose states are solved."""
    content, about = _content(grid, magnet)
    text = (PAGE / INDEX).read_text(encoding="utf-8")
    text = text.replace("<head>", f'<head>\n<meta http-equiv="Content-Security-Policy" content="{POLICY}">', 1)
    text = text.replace("</head>", f"<style>{STYLE} {HIDDEN}</style>\n</head>", 1)
    text = text.replace('<p id="notice"', f'{about}\n<p id="notice"', 1)
    text = text.replace("Reset to the paper's sensor", "Reset the load")
    text = re.sub(r'<link rel="stylesheet" href="([^"]+)">', lambda link: _style(link[1]), text)
    return re.sub(r'<script src="([^"]+)"></script>', lambda script: _scripts(script[1], content), text)


def _content(grid: Grid, magnet: Magnet) -> tuple[Data, str]:
    """Return everything that the page's engine reads, and what the page says of itself, as HTML."""
    design = grid.design
    response, errors = offline_tables.response(grid)
    curve = state_answers.curve(design, magnet, LEVEL, estimate=True)
    curves = {level: state_answers.with_formulas(curve, design, level) for level in beam.LEVELS}
    sensor, elements = _sensor(design), offline_tables.elements(design)
    content: Data = {
        "fields": _fields(grid),
        "sensor": sensor,
        "model": "finite elements",
        "level": LEVEL,
        "fixed": {"D": design.D, "L": design.L, "H": design.H, "elements": state_pictures.element_places(design)},
        "plane": offline_tables.plane(grid, response).data(),
        "elements": elements,
        "pictures": offline_tables.pictures(grid, magnet),
        "stability": state_answers.by_finite_elements(design, magnet, LEVEL),
        "curves": curves,
        "commands": state_exports.without_load(design, magnet, LEVEL),
        "files": {"design.toml": user_input.design_text(design)},
        "curve_files": {level: state_exports.of_curve(one).decode() for level, one in curves.items()},
        "refusal": _words("refusal", grid),
    }
    volts = ""
    if elements is not None and "rest" in elements:
        readings, reading_errors = offline_tables.readings(grid)
        decoded, decoding_errors = offline_tables.decoded(grid, response, reading_errors)
        volts = f", a reading by {_figure(reading_errors.max())} {elements['units'][0]}"
        if np.isfinite(decoding_errors).any():
            volts += f", the decoded force by {_figure(np.nanmax(decoding_errors))} N"
        content |= {"readings": readings.data(), "decoded": decoded.data()}
    tangential, _, normal, shift, _, sinking, tilt = map(_figure, np.nanmax(errors, axis=0))
    off: Data = {"tangential": tangential, "normal": normal, "shift": shift, "sinking": sinking, "tilt": tilt}
    return content, _words("about", grid, sensor=html.escape(sensor), volts=html.escape(volts), **off)


def _fields(grid: Grid) -> list[Data]:
    design, D = grid.design, grid.design.D
    depth, shear = grid.roots[-1] ** 2 * D, float(grid.shears[-1])
    ends = {"depth": (0.0, _rounded(depth)), "shear": (-shear, shear)}
    fields = []
    for field in explorer_fields(design):
        name = field["name"]
        # the states are those at rest
        if name in RATES:
            continue
        if name in ends:
            low, high = ends[name]
            field |= {"low": low, "high": high, "slider": [low, high]}
        if name == "depth":
            field["value"] = min(state_exports.first_depth(design), ends["depth"][1])
        if name == "magnet":
            field["value"] = magnet_of(design)
        fields.append(field | {"fixed": name not in MOVED})
    return fields


def _rounded(depth: float) -> float:
    return float(np.floor(100 * depth + 1e-6) / 100)


def _sensor(design: Design) -> str:
    changed = state_exports.address_fields(design)
    texts = [f"{name} {value}" for name, value in changed.items() if name not in ("preset", "depth")]
    return f"the paper's sensor{' with ' if texts else ''}{', '.join(texts)}"


def _words(part: str, grid: Grid, **more: Any) -> str:
    """Return a part of what the page says of itself: its `refusal` of a load, or `about`, as HTML."""
    lowest = grid.roots[np.flatnonzero(np.isfinite(grid.rows[:, 1, 0]))][:1] ** 2 * grid.design.D
    presses = sum(not shear for _, shear, _ in grid.states)
    values: Data = {"part": part, "level": LEVEL, "lowest": lowest.tolist(), "presses": presses}
    values |= {"sheared": len(grid.states) - presses, "checks": len(grid.checks)}
    values |= {"deepest": grid.roots[-1] ** 2 * grid.design.D, "farthest": grid.shears[-1]}
    return " ".join(rendered(PAGE / "fixed_design.html.j2", **values, **more).split())


def _figure(value: float) -> str:
    return f"{value:.2g}"


def _style(name: str) -> str:
    return f"<style>\n{(PAGE.parent / name).read_text(encoding='utf-8')}\n</style>"


def _scripts(name: str, content: Mapping[str, Any]) -> str:
    """Return a script of the page inline; for the live engine, the data and the engine that replaces it."""
    if name != LIVE:
        return _script((PAGE.parent / name).read_text(encoding="utf-8"))
    data = f"window.MAGTIP_OFFLINE = {as_json(content)};"
    return f"{_script(data)}\n{_script((PAGE / 'offline_engine.js').read_text(encoding='utf-8'))}"


def _script(text: str) -> str:
    """Return a script as an element; in its strings, "<" of what HTML would read is written as an escape."""
    safe = re.sub(r"<(?=/script|!--|script)", r"\\x3c", text, flags=re.IGNORECASE)
    return f"<script>\n{safe}\n</script>"
