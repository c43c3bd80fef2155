"""The page of a report: one HTML file with its style, scripts and data, which opens without a network.

Texts of files enter the page escaped, data as JSON in which no tag can end; the page's Content-Security-Policy lets
only its own scripts run, by their hashes, and lets nothing be loaded or evaluated: Vega, which draws the
figures, interprets its expressions.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import Load
from geometry.messages import Progress
from studies.output import atomic_files, provenance
from studies.output.figures import Figure
from studies.output.literals import one_line
from studies.output.text_tables import quantity_name
from studies.quantities import shown
from studies.web import folder_contents, report_sections
from studies.web.page_content import PAGE, as_json, lead_of, page_html, page_theme, sources, title_of
from studies.web.report_sections import Section

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget

SCRIPTS = ("format", "theme", "exports", "figures", "sensor_view", "report_surface", "report_page")
"""Scripts of every report; three.js comes before them where there is a figure in 3D."""
GENERATOR = "magtip report"
"""Text by which a page of a report is recognised, so that no other file is replaced."""
MOST_BYTES = 9_000_000
"""Largest size of a page; Vega takes one million bytes of it."""
MOST_TABLE_BYTES = 2_500_000
"""Bytes of whole tables in a page; those beyond, the largest first, are left out with a sentence."""
MOST_SOLVED = 4
"""Greatest number of designs that are solved for a page: each takes half a megabyte."""
MOST_PICTURE_BYTES = 1_800_000
"""Bytes of pictures in a page."""


def report(
    folder: Path,
    out: Path | None = None,
    *,
    command: str = "",
    solve: bool = True,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write the page of a folder of results.

    Parameters
    ----------
    out : file of the page, .html; default: report.html in the folder.
    command : command line that the page names.
    solve : whether sensors that the folders name are solved for the figures in 3D.

    Returns
    -------
    What the command prints: file, size_MB, numbers of sections, figures and surfaces, and sentences on what was left
    out, with the folder they belong to.

    Raises
    ------
    BadInput
        The folder is missing, holds no results or those of a newer version, or the file cannot be written.
    """
    contents = folder_contents.read(folder)
    file = atomic_files.check_output_file(out or folder / "report.html", ".html", ".htm")
    atomic_files.check_apart([file], folder_contents.inputs(contents))
    sections, solved = [], list[tuple[Design, "Load | ForceTarget | None"]]()
    for k, one in enumerate(contents):
        if progress is not None:
            progress(k / len(contents), one.name or str(folder))
        # a design that several folders name is solved and shown once, and the first ones only
        state = report_sections.state_of(one)
        new = solve and state is not None and state not in solved
        sections.append(report_sections.section(one, solve=new and len(solved) < MOST_SOLVED))
        if new and state is not None and not one.solutions:
            solved.append(state)
    text = page(folder, sections, command)
    size = len(text.encode())
    if size > MOST_BYTES:
        raise BadInput(
            f"the page would have {size / 1e6:.1f} MB and may have {MOST_BYTES / 1e6:.0f} MB: report a sub-folder"
        )
    atomic_files.write_text(file, text)
    return {
        "file": str(file),
        "size_MB": round(size / 1e6, 2),
        "sections": len(sections),
        "figures": sum(len(one.figures) for one in sections),
        "surfaces": sum(len(one.surfaces) for one in sections),
        "warnings": [f"{one.name}: {remark}" if one.name else remark for one in sections for remark in one.remarks],
    }


def page(folder: Path, sections: Sequence[Section], command: str) -> str:
    """Return the text of the page."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PAGE), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    environment.filters |= {"minus": minus, "file_name": _file_name, "cell": _cell, "quantity": quantity_name}
    environment.globals["count"] = _count
    tables, left_out = _kept_tables(sections)
    shown: list[dict[str, Any]] = []
    for one, title in zip(sections, _titles(sections), strict=True):
        room = MOST_PICTURE_BYTES - sum(len(source) for item in shown for source in item["sources"].values())
        shown.append({"section": one, "title": title, "lead": lead_of(one.contents), **_content(one, left_out, room)})
    every = list(enumerate(sections))
    data: dict[str, Any] = {
        "figures": {f"f{k}-{i}": figure_data(figure) for k, one in every for i, figure in enumerate(one.figures)},
        "surfaces": {f"s{k}-{i}": surface for k, one in every for i, surface in enumerate(one.surfaces)},
        "tables": tables,
        "theme": page_theme(),
    }
    scripts = [
        (PAGE / "vendor" / "vega.js").read_text("utf-8"),
        *([(PAGE / "vendor" / "three.js").read_text("utf-8")] if data["surfaces"] else []),
        *((PAGE / f"{name}.js").read_text("utf-8") for name in SCRIPTS),
    ]
    title = one_line(folder.resolve().name or str(folder))
    count = len(data["figures"]) + len(data["surfaces"])
    text = environment.get_template("report.html.jinja").render(
        generator=GENERATOR,
        title=f"Results in {title}",
        lead=f"{_count(count, 'figure')} of {_count(len(sections), 'folder')}. The pointer or, on a figure with "
        "the focus, the arrow keys read it off; its numbers are below it, also as CSV.",
        style=Markup("".join((PAGE / name).read_text("utf-8") for name in ("theme.css", "report.css"))),
        scripts=[Markup(text) for text in scripts],
        hashes=" ".join(f"'sha256-{_digest(text)}'" for text in scripts),
        sections=shown,
        # no tag can end in a script
        data=Markup(as_json(data).replace("<", "\\u003c")),
        origin=provenance.versions(("jinja2", "altair", "vl-convert-python", "pyvista")),
        command=command,
        origins=_origins(sections),
    )
    return str(text)


def minus(text: str) -> str:
    """Return a text with true minus signs before numbers, and with numbers that stay beside their unit.

    >>> minus("from -5 to 3 mm, see press-1.csv")
    'from −5 to 3\\xa0mm, see press-1.csv'
    """
    signed = re.sub(r"(?<![\w.)-])-(?=\d)", "\N{MINUS SIGN}", text)
    return re.sub(r"(?<=\d) (?=(?:%|mm|N|MPa|V|T|mT|mN|rad|Hz)(?!\w))", "\N{NO-BREAK SPACE}", signed)


def _count(number: int, name: str) -> str:
    return f"{number} {name}{'' if number == 1 else 's'}"


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _kept_tables(
    sections: Sequence[Section],
) -> tuple[dict[str, list[list[str]]], dict[tuple[str, str], str]]:
    """Return the tables that the page has, the smallest first, and why it has not the others."""
    every = [
        (one.name, name, one.contents.texts.get(name, ""), table.size)
        for one in sections
        for name, table in one.contents.tables.items()
    ]
    kept: dict[str, list[list[str]]] = {}
    left_out: dict[tuple[str, str], str] = {}
    total = 0
    for folder, name, text, size in sorted(every, key=lambda each: len(each[2]) or 20 * each[3]):
        total += len(text) or 20 * size
        if not text:
            left_out[folder, name] = "it is no CSV file"
        elif total > MOST_TABLE_BYTES:
            left_out[folder, name] = f"it has {len(text) / 1e6:.1f} MB, too many for the page"
        else:
            kept[f"{folder}/{name}"] = list(csv.reader(io.StringIO(text)))
    return kept, left_out


def _titles(sections: Sequence[Section]) -> list[str]:
    titles = [title_of(section.contents) for section in sections]
    names = [section.contents.name or section.contents.path.resolve().name for section in sections]
    return [
        f"{title} ({name})" if titles.count(title) > 1 else title for title, name in zip(titles, names, strict=True)
    ]


def _content(section: Section, left_out: Mapping[tuple[str, str], str], room: int) -> dict[str, Any]:
    """Return tables, pictures and pages of a section as the template takes them."""
    contents, files = section.contents, []
    for name, table in contents.tables.items():
        reason = left_out.get((section.name, name), "")
        text = f"{name}: {_count(len(table), 'row')}, {_count(table.shape[1], 'column')}"
        text += f" (not in this page: {reason})" if reason else ""
        files.append({"id": "" if reason else f"{section.name}/{name}", "name": name, "text": text})
    pictures, used = sources(contents, section.replaced, room, section.remarks), set[str]()
    pages = {name: page_html(text, pictures, used) for name, text in contents.pages.items()}
    loose = {name: source for name, source in pictures.items() if name not in used}
    return {"files": files, "pages": pages, "pictures": loose, "sources": pictures}


def _cell(value: Any) -> tuple[str, bool]:
    """Return the text of a cell, and whether it is a number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return {"True": "yes", "False": "no"}.get(str(value), str(value)), False
    return shown(number, digits=4, nothing=""), True


def figure_data(figure: Figure) -> dict[str, Any]:
    """Return a figure as the page's script takes it: the columns that its CSV has, and Vega-Lite's description.

    Tables stand there as columns: numbers to six digits, None for NaN, texts by their places in a list of all texts.
    """
    spec = figure.spec()
    columns = [str(name) for name in figure.data]
    for name, rows in spec["datasets"].items():
        keys = list(dict.fromkeys(key for row in rows for key in row))
        spec["datasets"][name] = {key: _packed([row.get(key) for row in rows]) for key in keys}
    spec["description"] = f"{figure.title}. {figure.caption} Arrow keys read it off."
    return {"spec": spec, "columns": columns}


def _packed(column: list[Any]) -> list[Any] | dict[str, list[Any]]:
    if any(isinstance(value, str) for value in column):
        places = {value: k for k, value in enumerate(dict.fromkeys(column))}
        return {"texts": list(places), "at": [places[value] for value in column]}
    return [float(f"{value:.6g}") if isinstance(value, float) else value for value in column]


def _file_name(title: str, folder: str) -> str:
    """Return a name for a CSV file.

    >>> _file_name("Press force: 1 mm", "out/demo")
    'out-demo-press-force-1-mm.csv'
    """
    words = re.sub(r"[^a-z0-9]+", "-", f"{folder} {title}".lower()).strip("-")
    return f"{words[:80] or 'figure'}.csv"


def _origins(sections: Sequence[Section]) -> list[dict[str, str]]:
    rows = []
    for one in sections:
        contents = one.contents
        texts = [contents.run.made] if contents.run is not None else []
        texts += [str(record["made"]) for record in contents.records.values() if isinstance(record.get("made"), str)]
        texts += filter(None, map(provenance.origin_in, contents.pages.values()))
        rows += [{"name": one.name or ".", "text": text} for text in dict.fromkeys(texts)]
    return rows
