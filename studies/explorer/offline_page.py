"""The explorer's page as one HTML file without a server, for one design: what `magtip explore --export` writes.

The page is the server's: its scripts and styles are inlined as classic scripts, in their order, with
`offline_engine.js` in place of `live_engine.js`. Its numbers come from the surrogate, which the page computes itself
(see `offline_model`), and its pictures from sections that are solved while the page is written (`offline_sections`).
A Content-Security-Policy in the page forbids every request.
"""

from __future__ import annotations

import csv
import html
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from geometry.messages import Progress
from studies import surrogate
from studies.explorer import offline_data, offline_sections, state_commands
from studies.explorer.explorer_fields import explorer_fields
from studies.explorer.explorer_state import RATES
from studies.output import atomic_files
from studies.surrogate import surrogate_range, surrogate_response

PAGE = Path(__file__).parent / "page"
"""Files of the page."""
INDEX, LIVE = "index.html", "page/live_engine.js"
ERRORS = Path(str(surrogate.__file__)).with_name("surrogate_errors.csv")
"""Errors of the shipped surrogate on unseen beams: summary.csv of its study."""
MODULES = (
    *("python_text.js", "input_checks.js", "gaussian_process.js", "surrogate_response.js"),
    *("cylinder_field.js", "hall_readings.js", "beam_formulas.js", "offline_model.js", "stored_sections.js"),
    *("state_commands.js", "offline_engine.js"),
)
"""Scripts in place of the live engine, each after those that it uses."""
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing is loaded from, or sent to, any address."""
STYLE = "#about-model { padding: 6px 16px; font-size: 13px } #about-model p { margin: 4px 0 0 }"
HIDDEN = (
    'label:has(#level), [data-export="mold.zip"], [data-export="fields.vtu"], #vibration-panel, #loop-panel '
    "{ display: none }"
)
"""Controls and panels that need a server."""
ERROR_FIGURES = (
    ("press force", "press", "force"),
    ("shift", "press", "shift"),
    ("contact radius", "press", "contact_radius"),
    ("shear force along the shear", "shear", "force_x"),
    ("normal", "shear", "force_z"),
    ("shift along the shear", "shear", "shift_x"),
    ("tilt", "shear", "tilt"),
    ("critical depth", "critical depth", "depth"),
    ("first mode", "mode", "frequency"),
)
"""Figures of the sentence on errors: text, and the row of the table."""


def write(design: Design, path: Path, progress: Progress | None = None) -> Path:
    """Write the page of a design; return its path.

    Raises
    ------
    BadInput
        The surrogate refuses the design: without its range the page would have no numbers.
    """
    check(design)
    sections = offline_sections.solve(design, progress=progress)
    atomic_files.write_text(path, page(design, offline_sections.data(design, sections)))
    return path


def check(design: Design) -> None:
    """Raise BadInput if the surrogate refuses the design."""
    reason = surrogate_response.refusal(design, Load(depth=2 * surrogate_range.SHALLOWEST * design.D), "rigid")
    if reason:
        raise BadInput(f"{reason}, and a page without a server has no other model: leave --export out")


def page(design: Design, sections: Mapping[str, Any]) -> str:
    """Return the page with the sections of its design."""
    # the surrogate is static: vibrations and loops need finite elements
    fields = [field for field in explorer_fields(paper()) if field["name"] not in RATES]
    data = {"fields": fields, "model": offline_data.constants(), "sections": sections}
    state = urlencode(state_commands.address_fields(design))
    # the first state is that of the design, unless the address has one
    first = (
        f"{_assigned(data)}\nif (!location.hash && {json.dumps(state)}) location.replace({json.dumps('#' + state)});"
    )
    text = (PAGE / INDEX).read_text(encoding="utf-8")
    text = text.replace("<head>", f'<head>\n<meta http-equiv="Content-Security-Policy" content="{POLICY}">', 1)
    text = text.replace("</head>", f"<style>{STYLE} {HIDDEN}</style>\n</head>", 1)
    text = text.replace('<p id="notice"', f'{_details()}\n<p id="notice"', 1)
    text = re.sub(r'<link rel="stylesheet" href="([^"]+)">', lambda link: _style(link[1]), text)
    return re.sub(r'<script src="([^"]+)"></script>', lambda script: _scripts(script[1], first), text)


def about() -> str:
    """Return the sentence on the model's errors, from the table of the surrogate's test that is shipped.

    >>> about()[:62]
    "95th percentiles of the surrogate's errors on 120 unseen beams"
    """
    with ERRORS.open(encoding="utf-8", newline="") as file:
        rows = {(row["kind"], row["quantity"]): row for row in csv.DictReader(file) if row["region"] == "all"}
    figures = ", ".join(
        f"{text} {float(rows[kind, quantity]['p95_percent']):.2g} %" for text, kind, quantity in ERROR_FIGURES
    )
    beams = rows["press", "force"]["beams"]
    return f"95th percentiles of the surrogate's errors on {beams} unseen beams: {figures}."


def _details() -> str:
    return (
        '<details id="about-model" class="soft"><summary>Without a server: numbers by the surrogate of the finite '
        "elements, with half widths of 90 % intervals; pictures from stored sections, all at rest: "
        "vibrations and loading cycles need magtip explore, and relaxation changes commands and exports only. "
        "Show the errors of the surrogate.</summary>"
        f"<p>{html.escape(about())}</p></details>"
    )


def _style(name: str) -> str:
    return f"<style>\n{(PAGE.parent / name).read_text(encoding='utf-8')}\n</style>"


def _scripts(name: str, first: str) -> str:
    """Return a script of the page inline; for the live engine, the data and the scripts that replace it."""
    if name != LIVE:
        return _script((PAGE.parent / name).read_text(encoding="utf-8"))
    modules = [(PAGE / module).read_text(encoding="utf-8") for module in MODULES]
    return "\n".join(_script(text) for text in (first, *modules))


def _assigned(data: Mapping[str, Any]) -> str:
    return f"window.MAGTIP_OFFLINE = {json.dumps(data, allow_nan=False, separators=(',', ':'))};"


def _script(text: str) -> str:
    """Return a script as an element; in its strings, "<" of what HTML would read is written as an escape."""
    safe = re.sub(r"<(?=/script|!--|script)", r"\\x3c", text, flags=re.IGNORECASE)
    return f"<script>\n{safe}\n</script>"
