"""The reference of the site, made from the program: verbs, fields, quantities, tasks, and the two drawings.

Needs no Sphinx, so that tests can read the pages.
"""

import dataclasses
import functools
import math
import re
from importlib import metadata
from pathlib import Path

import jinja2

import magtip
from docs.documented_commands import PICTURES, REFERENCE
from geometry.design import Design, paper
from geometry.loads import Load
from studies.cli.commands import app
from studies.fabrication import symbol_drawings
from studies.parts.requirements import Requirements
from studies.quantities import QUANTITIES, UNITS

DOCS = Path(__file__).resolve().parent
VERBS = [verb for verb in app if not verb.startswith("-")]
PAGES = ["design", "load", "python", "quantities", "requirements", "verbs", *(f"verb/{verb}" for verb in VERBS)]
"""Names of the pages, each with its template; those of verbs share one."""
DRAWINGS = {
    "sensor.svg": symbol_drawings.lengths,
    "loads.svg": symbol_drawings.loads,
    "reference/chips.svg": symbol_drawings.chips,
    "reference/mesh.svg": symbol_drawings.mesh,
    "reference/tips.svg": symbol_drawings.tips,
}
TASK = re.compile(r"^\| ([^|]+) \| `(magtip \w[^|]*)` \|$", re.M)


def version() -> str:
    return metadata.version("magtip")


def page(name: str) -> str:
    """Return the text of a page of the reference, in Markdown."""
    loader = jinja2.FileSystemLoader(DOCS / "templates")
    templates = jinja2.Environment(loader=loader, trim_blocks=True, undefined=jinja2.StrictUndefined)
    kind, _, verb = name.partition("/")
    return templates.get_template(f"{kind}.md.j2").render(**(of_verb(verb) if verb else VALUES[name]()))


def write() -> None:
    """Write all pages and drawings; files that stay the same are not touched."""
    REFERENCE.joinpath("verb").mkdir(parents=True, exist_ok=True)
    texts = {REFERENCE / f"{name}.md": functools.partial(page, name) for name in PAGES}
    texts |= {DOCS / name: functools.partial(draw, paper()) for name, draw in DRAWINGS.items()}
    for path, make in texts.items():
        text = make()
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def fields(record: type) -> list[dict[str, str]]:
    """Return name, default, unit, range and words of each field of a dataclass, as text."""
    return [
        {
            "name": spec.metadata.get("column") or spec.name,
            "default": shown(spec.default),
            "unit": UNITS[spec.metadata["unit"]],
            "range": within(spec.metadata),
            "words": spec.metadata["text"] + (" *(assumed)*" if spec.metadata.get("assumed") else ""),
        }
        for spec in dataclasses.fields(record)
    ]


def shown(default: object) -> str:
    """Return a default as text, nothing where there is none."""
    if isinstance(default, tuple):
        return ", ".join(default)
    return "" if default in (None, dataclasses.MISSING) else f"{default}"


def within(about: dict) -> str:
    """Return what a field may be, from its metadata: a range, choices, or nothing for free text."""
    parts = [", ".join(about.get("choices") or about.get("names") or ())]
    if "low" in about and math.isfinite(about["low"]) and math.isfinite(about["high"]):
        parts.append(f"{about['low']:g} to {about['high']:g}")
    elif "low" in about and math.isfinite(about["low"]):
        parts.append(f"{'above' if about['open_low'] else 'from'} {about['low']:g}")
    return "; ".join(filter(None, parts))


@functools.cache
def helps() -> dict[str, str]:
    """Return the help of each verb as Markdown, and under "" the list of verbs."""
    texts = re.split(r"^## magtip (\w+)$", app.generate_docs().partition("**Design**:")[2], flags=re.M)
    listed = "**Design**:" + re.sub(r"\(#magtip-(\w+)\)", r"(verb/\1.md)", texts[0])
    return {"": listed} | dict(zip(texts[1::2], texts[2::2], strict=True))


def of_verb(verb: str) -> dict[str, object]:
    """Return the help of a verb, and its rows in the table of verbs."""
    rows = TASK.findall((DOCS.parent / "studies" / "README.md").read_text("utf-8"))
    rows = [(to, command) for to, command in rows if command.split()[1] == verb]
    here = [(re.sub(r"\]\((?!http)([^)]+)\)", r"](../../../studies/\1)", to), command) for to, command in rows]
    text = re.sub(r"^###", "##", helps()[verb], flags=re.M)
    intro, options = re.split(r"^(?=\*\*Arguments|\*\*Parameters|## )", text, maxsplit=1, flags=re.M)
    shown = dict(re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", PICTURES.read_text("utf-8"), flags=re.M | re.S))
    result = shown.get(verb, "").replace("](../", "](../../../").strip()
    about = {"verb": verb, "intro": intro.strip(), "options": options, "tasks": here, "result": result}
    return about | {"keys": keys_of(verb)}


def keys_of(verb: str) -> str:
    """Return the hand-written part of a verb's page, below its title, or nothing."""
    path = DOCS / "verbs" / f"{verb}.md"
    text = path.read_text("utf-8").partition("\n")[2].strip() if path.exists() else ""
    return re.sub(r"^##", "###", text, flags=re.M).replace("](../", "](../../")


VALUES = {
    "design": lambda: {"fields": fields(Design)},
    "load": lambda: {"fields": fields(Load)},
    "python": lambda: {"names": {name: isinstance(getattr(magtip, name), type) for name in magtip.__all__}},
    "quantities": lambda: {"quantities": QUANTITIES.values(), "units": UNITS},
    "requirements": lambda: {"fields": fields(Requirements)},
    "verbs": lambda: {"text": helps()[""], "verbs": VERBS},
}
"""What each template shows."""
