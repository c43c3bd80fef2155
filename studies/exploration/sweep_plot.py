"""The pictures of a sweep: `draw` makes as few as show every case; each quantity has its values and its errors.

Which axis is shown how is chosen in `sweep_views`. Axes without effect on anything shown are named in a note.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.design import BadInput
from studies.exploration import sweep_lines, sweep_maps, sweep_notes, sweep_titles, sweep_views
from studies.exploration.sweep_cube import Cube, cube_of, failed
from studies.exploration.sweep_views import MOST_PICTURES, Block, Place, Section, View
from studies.exploration.sweep_views import Shown as Shown
from studies.output import table_plots

NARROW, BROAD = 7.0, 9.0
"""Width of a picture with at most three columns of panels, and with more, in."""
MOST_NARROW = 3
LINE_HEIGHT, SMALL_HEIGHT, MAP_HEIGHT = 2.45, 1.85, 2.7
"""Heights of a row of lines, of small panels, and of one wide map, in."""
MOST_HEIGHT = 10.9
"""Greatest height of the panels of a picture, in."""


def draw(
    path: Path,
    columns: Mapping[str, NDArray[Any]],
    axes: Mapping[str, Sequence[float | str]],
    shown: Sequence[Shown],
    *,
    sampled: bool = False,
    notes: Sequence[str] = (),
) -> list[Path]:
    """Draw a sweep into one or several files.

    Parameters
    ----------
    path : first file; further ones end in -2, -3 ... before the suffix, and older files of such names are deleted.
    columns : all rows, shape (n,) each: axes, quantities and errors (NaN: none), `status` and, if there is one,
        `message`. A case failed if its status is not "ok".
    axes : values of each axis by its column, in the study's order; of zipped axes the first.
    sampled : whether the points fill the space of the axes without a grid.
    notes : sentences below the last picture.

    Returns
    -------
    The files, in order.
    """
    if not axes or not shown or not len(columns["status"]):
        raise BadInput("a picture of a sweep needs an axis, a quantity and a row: give each of them")
    names = (path if k == 1 else path.with_stem(f"{path.stem}-{k}") for k in itertools.count(1))
    if sampled:
        from studies.exploration import sweep_scatter

        files = sweep_scatter.draw(names, columns, axes, shown, [*sweep_notes.failures(columns), *notes])
    else:
        files = _grid(names, columns, axes, shown, notes)
    for old in names:
        if not old.is_file():
            break
        old.unlink()
    return files


def _grid(
    names: Iterator[Path],
    columns: Mapping[str, NDArray[Any]],
    axes: Mapping[str, Sequence[float | str]],
    shown: Sequence[Shown],
    notes: Sequence[str],
) -> list[Path]:
    """Draw a sweep over a grid."""
    cube = cube_of(columns, axes)
    shown = [quantity for quantity in (_with_values(cube, q) for q in shown) if quantity.values] or shown
    every = [c for quantity in shown for c in (*quantity.values.values(), *quantity.errors.values())]
    own = [*sweep_notes.idle(cube, every), *sweep_notes.failures(columns)]
    most = max(1, MOST_PICTURES // sum(1 + len(quantity.errors) for quantity in shown))
    pages = _pages([unit for quantity in shown for unit in units(cube, quantity, most)])
    files = []
    for number, (page, file) in enumerate(zip(pages, names, strict=False), start=1):
        last = number == len(pages)
        said = [*sweep_notes.of_picture([block.section for block in page]), *own, *(notes if last else [])]
        if len(pages) > 1:
            said.append(f"Picture {number} of {len(pages)}.")
        _picture(file, page, cube, said)
        files.append(file)
        if last:
            break
    return files


def _with_values(cube: Cube, quantity: Shown) -> Shown:
    """Return a quantity without the models that have no value although cases succeeded."""
    if failed(cube.columns).all():
        return quantity
    by = [
        {m: c for m, c in models.items() if np.isfinite(np.asarray(cube.columns[c], dtype=float)).any()}
        for models in (quantity.values, quantity.errors)
    ]
    return replace(quantity, values=by[0], errors=by[1])


def units(cube: Cube, quantity: Shown, most: int) -> Iterator[list[Section]]:
    """Yield the sections that belong together, values by models and errors below, of `most` pictures each."""
    every = [*quantity.values.values(), *quantity.errors.values()]
    whole = sweep_views.view(cube.axes, cube.effective(every))

    def look(models: Mapping[str, str]) -> View:
        return sweep_views.pruned(whole, cube.axes, cube.effective(list(models.values())))

    def section(models: Mapping[str, str], *, error: bool) -> Section:
        own = sweep_views.folded(cube, look(models), list(models.values()), most)
        # colours mean models where they mean no axis
        free = not own.second and (whole.maps or not whole.second)
        numbers = [list(quantity.values).index(m) if m in quantity.values else k for k, m in enumerate(models)]
        colours = numbers if free else ()
        unit = quantity.error_unit if error else quantity.unit
        return sweep_views.section(cube, own, quantity.label, unit, models, colours, error=error)

    references = {m: c for m, c in quantity.values.items() if m not in quantity.errors} or dict(quantity.values)
    reference, others = next(iter(references.items())), dict(quantity.values)
    others.pop(reference[0])
    if not whole.second or len(quantity.values) <= 2:
        groups = [(dict(quantity.values), dict(quantity.errors))]
    else:
        groups = [
            (dict([reference, (m, c)]), {k: e for k, e in quantity.errors.items() if k == m})
            for m, c in others.items()
        ]
    if look(quantity.values).maps:
        groups = [(references, dict(quantity.errors))]
    for values, errors in groups:
        sections = []
        for error, by in ((False, values), (True, errors)):
            shared = look(by) if by else whole
            # a map has one model, and so have errors whose colours mean an axis
            apart = shared.maps or (error and bool(shared.second))
            parts = [{m: c} for m, c in by.items()] if apart else [by] if by else []
            sections += [section(part, error=error) for part in parts]
        yield sections


def _pages(grouped: Sequence[Sequence[Section]]) -> list[list[Block]]:
    """Put the blocks of all sections onto pictures: those that belong together onto one if there is room."""
    pages: list[list[Block]] = []
    for sections in grouped:
        own = [sweep_views.blocks(section) for section in sections]
        together = [list(blocks) for blocks in zip(*own, strict=True)] if len({*map(len, own)}) == 1 else []
        if not together or _height(together[0]) > MOST_HEIGHT:
            together = [[block] for blocks in own for block in blocks]
        for blocks in together:
            if pages and _fit(pages[-1], blocks):
                pages[-1] += blocks
            else:
                pages.append(list(blocks))
    return pages


def _height(blocks: Sequence[Block]) -> float:
    """Return the height of blocks below each other, in."""
    return sum(len(block.panels) * _row_height(block) for block in blocks)


def _fit(page: Sequence[Block], more: Sequence[Block]) -> bool:
    """Return whether blocks can stand below those of a picture: there is room, and colours mean the same."""
    sections = [block.section for block in (*page, *more)]
    lines = [section for section in sections if not section.view.maps]
    colours = {section.view.second for section in lines if section.view.second}
    colours |= {"model" for section in lines if section.colours}
    single = all(section.failures.shape[0] == 1 for section in sections)
    models = {section.models for section in lines if not section.error}
    return single and len(colours) <= 1 and len(models) <= 1 and _height([*page, *more]) <= MOST_HEIGHT


def _picture(file: Path, page: Sequence[Block], cube: Cube, notes: Sequence[str]) -> None:
    """Draw one picture: the blocks below each other, the legend above and the notes below."""
    columns = math.lcm(*(block.width for block in page))
    width = NARROW if max(block.width for block in page) <= MOST_NARROW else BROAD
    heights = [_row_height(block) for block in page for _ in block.panels]
    handles, across = table_plots.legend_columns(_handles(page, cube), width)
    text = "\n".join(part for note in notes for part in textwrap.wrap(note, int(width * 11)))
    height = sum(heights) + 0.27 * len(handles) / across + 0.19 * len(text.splitlines()) + 0.3
    with table_plots.sheet(file, width, height) as figure:
        grid = figure.add_gridspec(len(heights), columns, height_ratios=heights)
        top = 0
        for n, block in enumerate(page):
            panels = _panels(figure, grid, top, columns // block.width, block)
            if block.section.view.maps:
                sweep_maps.draw(figure, panels, block, cube.axes, 0.75 * width / block.width)
            else:
                sweep_lines.draw(panels, block, cube.axes, 0.8 * width / block.width)
            below, size = page[n + 1] if n + 1 < len(page) else None, (width / block.width, _row_height(block))
            sweep_titles.label(panels, block, cube.axes, page[n - 1] if n else None, below, size)
            top += len(block.panels)
        title = sweep_titles.of_picture(page[0], cube.axes)
        if handles:
            figure.legend(handles=handles, loc="outside upper center", ncols=across, frameon=False, title=title)
        elif title:
            figure.suptitle(title, fontsize=11)
        if text:
            figure.supxlabel(text, fontsize=10, color=sweep_lines.GREY)


def _row_height(block: Block) -> float:
    if block.width > MOST_NARROW and len(block.panels) > 1:
        return SMALL_HEIGHT
    return MAP_HEIGHT if block.section.view.maps else LINE_HEIGHT


def _panels(figure: Any, grid: Any, top: int, span: int, block: Block) -> dict[Place, Any]:
    """Return the panels of a block by their places."""
    return {
        place: figure.add_subplot(grid[top + r, c * span : (c + 1) * span])
        for r, row in enumerate(block.panels)
        for c, place in enumerate(row)
        if place is not None
    }


def _handles(page: Sequence[Block], cube: Cube) -> list[list[Any]]:
    """Return the groups of the legend's entries: models, values of the colours, bands and failed cases."""
    lines = [block.section for block in page if not block.section.view.maps]
    maps = [block.section for block in page if block.section.view.maps]
    values = [section for section in lines if not section.error]
    models = {h.get_label(): h for section in values or lines for h in sweep_lines.model_handles(section)}
    colours = {h.get_label(): h for section in lines for h in sweep_lines.colour_handles(section, cube.axes)}
    others = table_plots.band_handles() if any(section.error for section in lines) else []
    others += sweep_maps.handles(errors=[s for s in maps if s.error], empty=any(s.empty for s in maps))
    lost = failed(cube.columns)
    if lost.any():
        others.append(sweep_maps.failed_handle(int(lost.sum()), len(lost), maps=bool(maps)))
    return [group for group in (list(models.values()), list(colours.values()), others) if group]
