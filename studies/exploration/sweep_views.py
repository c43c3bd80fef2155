"""Choice of the views of a sweep: which axis is horizontal, which has colours or is vertical, which makes panels.

An axis of more than six values is horizontal; a second one of them makes maps, else there are lines with a colour for
each value of the longest other axis. A third axis makes columns of panels, a fourth one rows of panels, each further
one more pictures. What would need too many pictures is folded: the least effective axes are shown by their extremes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from studies.exploration import sweep_cube
from studies.exploration.sweep_axes import Axis
from studies.exploration.sweep_cube import Cube
from studies.output.text_tables import with_unit

MOST_LINES = 6
"""Greatest number of values of an axis that are shown by colours."""
MOST_COLUMNS, MOST_ROWS = 5, 4
"""Greatest numbers of columns and rows of panels in a picture."""
MOST_PICTURES = 12
"""Number of pictures beyond which axes are folded."""


@dataclass(frozen=True, slots=True)
class Shown:
    """One quantity to draw.

    Attributes
    ----------
    label, unit : such as "press force" and "N".
    values : column of the quantity by the label of each model, such as "FEM standard".
    errors : column of the error by the label of each model that has one.
    error_unit : of the errors.
    """

    label: str
    unit: str
    values: Mapping[str, str]
    errors: Mapping[str, str]
    error_unit: str = "%"


@dataclass(frozen=True, slots=True)
class View:
    """How the axes of a sweep are shown; an empty text means that there is no such axis.

    Attributes
    ----------
    maps : whether there are maps, else lines.
    x : horizontal axis.
    second : axis of the lines' colours, or vertical axis of the maps.
    across, down : axes of the columns and of the rows of panels.
    pages : axes with a picture for each value.
    folded : axes of which the extremes are shown.
    """

    maps: bool
    x: str
    second: str = ""
    across: str = ""
    down: str = ""
    pages: tuple[str, ...] = ()
    folded: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """One quantity to draw, or its error.

    Attributes
    ----------
    label, unit : of the quantity, and unit of the quantity or of its error.
    error : whether these are errors.
    models : labels of the models.
    values : of each model, shape (pages, rows, columns, second, x).
    spread : least and greatest value over the folded axes where there are any, of each model.
    alike : whether the values of all colours are the same, which one grey line then shows, of each model.
    failures : failed cases, same shape.
    colours : index of the colour of each model where colours mean models.
    """

    view: View
    label: str
    unit: str
    error: bool
    models: tuple[str, ...]
    values: tuple[Array, ...]
    spread: tuple[tuple[Array, Array], ...]
    alike: tuple[bool, ...]
    failures: Array
    colours: tuple[int, ...]

    @property
    def numbers(self) -> Array:
        """All values, with the least and greatest over folded axes, shape (n,)."""
        every = [*self.values, *(part for both in self.spread for part in both)]
        return np.concatenate([values[np.isfinite(values)] for values in every])

    @property
    def names(self) -> list[str]:
        """Axes that are shown or folded."""
        return [*_shown(self.view), *self.view.folded]

    @property
    def subject(self) -> str:
        """Label of the quantity or of its error, as the start of a sentence."""
        return f"Error of {self.label}" if self.error else self.label[:1].upper() + self.label[1:]

    @property
    def empty(self) -> bool:
        """Whether the model has no value at a place where no case failed."""
        return any(bool((np.isnan(values) & (self.failures == 0)).any()) for values in self.values)

    @property
    def name(self) -> str:
        """Label with unit."""
        return with_unit(f"error of {self.label}" if self.error else self.label, self.unit)


def view(axes: Mapping[str, Axis], effective: Collection[str]) -> View:
    """Choose how axes are shown of which some are effective."""
    names = [name for name in axes if name in effective] or [next(iter(axes))]
    long = [name for name in names if len(axes[name]) > MOST_LINES]
    numbers = [name for name in names if not axes[name].texts]
    x = next(iter([name for name in long if name in numbers] or long or numbers or names))
    others = sorted((name for name in names if name != x), key=lambda name: -len(axes[name]))
    second, across, down, *pages = [*others, "", "", ""]
    maps = bool(second) and len(axes[second]) > MOST_LINES
    return View(maps, x, second, across, down, tuple(name for name in pages if name))


def pruned(whole: View, axes: Mapping[str, Axis], effective: Collection[str]) -> View:
    """Return the view without axes that have no effect; without its x or a map's vertical axis it is chosen anew."""
    if not effective:
        return View(maps=False, x=whole.x)
    if whole.x not in effective or (whole.maps and whole.second not in effective):
        return view(axes, effective)
    second, across, down = (name if name in effective else "" for name in (whole.second, whole.across, whole.down))
    if not across:
        across, down = down, ""
    pages = tuple(name for name in whole.pages if name in effective)
    return replace(whole, second=second, across=across, down=down, pages=pages)


def section(
    cube: Cube, look: View, label: str, unit: str, columns: Mapping[str, str], colours: Sequence[int], *, error: bool
) -> Section:
    """Return a quantity, or its error, in the order of its view; axes without effect take their first result."""
    values = [_ordered(cube, look, cube.values(column)) for column in columns.values()]
    spread = []
    if look.folded:
        for column in columns.values():
            both = [_ordered(cube, look, reduce(cube, look, cube.values(column))) for reduce in (_least, _greatest)]
            spread.append((both[0], both[1]))
    failures = cube.failures().sum(
        axis=tuple(k for k, n in enumerate(cube.axes) if n not in _shown(look)), keepdims=True
    )
    ordered = _ordered(cube, look, failures)
    alike = tuple(not look.folded and ordered.shape[3] > 1 and _alike(part) for part in values)
    return Section(
        look, label, unit, error, tuple(columns), tuple(values), tuple(spread), alike, ordered, tuple(colours)
    )


def _alike(values: Array) -> bool:
    """Return whether all colours have the same values, and at the same places, shape as `Section.values`."""
    some = np.isfinite(values)
    return sweep_cube.same(values, axis=3) and bool((some == some[:, :, :, :1]).all())


def _shown(look: View) -> list[str]:
    """Return the axes with a dimension in a section."""
    return [name for name in (*look.pages, look.down, look.across, look.second, look.x) if name]


def _least(cube: Cube, look: View, values: Array) -> Array:
    folded = tuple(k for k, name in enumerate(cube.axes) if name in look.folded)
    return np.asarray(np.fmin.reduce(values, axis=folded, keepdims=True))


def _greatest(cube: Cube, look: View, values: Array) -> Array:
    return -_least(cube, look, -values)


def _ordered(cube: Cube, look: View, values: Array) -> Array:
    """Return values over all axes as shape (pages, rows, columns, second, x)."""
    names = list(cube.axes)
    values = sweep_cube.extreme(values, [names.index(name) for name in look.folded])
    idle = [k for k, name in enumerate(names) if name not in _shown(look) and name not in look.folded]
    values = sweep_cube.first(values, idle)
    order = [names.index(name) for name in _shown(look)]
    values = values.transpose([k for k in range(len(names)) if k not in order] + order)
    sizes = [len(cube.axes[name]) if name else 1 for name in (look.down, look.across, look.second, look.x)]
    return values.reshape(-1, *sizes)


def folded(cube: Cube, look: View, columns: Sequence[str], most: int) -> View:
    """Return a view in which the least effective axes of panels are folded, so that it has few pictures."""
    while look.across and picture_count(look, cube.axes) > most:
        panels = [name for name in (look.across, look.down, *look.pages) if name]
        values = [cube.values(column) for column in columns]
        names = list(cube.axes)
        least = min(panels, key=lambda name: sum(sweep_cube.effect(cube_, names.index(name)) for cube_ in values))
        panels.remove(least)
        across, down, *pages = [*panels, "", ""]
        rest = tuple(name for name in pages if name)
        look = replace(look, across=across, down=down, pages=rest, folded=(*look.folded, least))
    return look


def picture_count(look: View, axes: Mapping[str, Axis]) -> int:
    """Return the number of pictures of a view."""
    pages = math.prod(len(axes[name]) for name in look.pages)
    across = len(axes[look.across]) if look.across else 1
    if look.down:
        return pages * math.ceil(across / MOST_COLUMNS) * math.ceil(len(axes[look.down]) / MOST_ROWS)
    return pages * math.ceil(across / (MOST_COLUMNS * MOST_ROWS))


Place = tuple[int, int, int]
"""Indices of a panel: page, row, column."""


@dataclass(frozen=True, slots=True)
class Block:
    """Panels of one section in a picture.

    Attributes
    ----------
    panels : the places of the panels, row by row; None where a row has no more.
    wrapped : whether the columns of the section continue in further rows.
    """

    section: Section
    panels: tuple[tuple[Place | None, ...], ...]
    wrapped: bool

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.panels[0])

    def places(self) -> Iterator[tuple[tuple[int, int], Place]]:
        """Yield row and column of each panel with its place."""
        for r, row in enumerate(self.panels):
            for c, place in enumerate(row):
                if place is not None:
                    yield (r, c), place


def blocks(drawn: Section) -> list[Block]:
    """Return the panels of a section, in as many blocks as there are pictures."""
    pages, rows, columns = drawn.failures.shape[:3]
    many: list[Block] = []
    for page in range(pages):
        if rows == 1:
            width = columns if columns <= MOST_COLUMNS else _width(columns)
            places = [(page, 0, c) for c in range(columns)]
            lines = [places[k : k + width] for k in range(0, columns, width)]
            full = [(*line, *[None] * (width - len(line))) for line in lines]
            for part in _chunks(len(full), MOST_ROWS):
                many.append(Block(drawn, tuple(full[r] for r in part), len(full) > 1))
        else:
            for part in _chunks(rows, MOST_ROWS):
                for own in _chunks(columns, MOST_COLUMNS):
                    many.append(Block(drawn, tuple(tuple((page, r, c) for c in own) for r in part), wrapped=False))
    return many


def _width(count: int) -> int:
    """Return the number of columns, 4, 5 or 3, that leaves the fewest panels of the last row free.

    >>> _width(12), _width(20), _width(9)
    (4, 4, 3)
    """
    return min((4, 5, 3), key=lambda width: (-count % width, width == 3))


def _chunks(count: int, most: int) -> list[range]:
    """Return ranges of nearly equal length.

    >>> _chunks(7, 5)
    [range(0, 4), range(4, 7)]
    """
    parts = math.ceil(count / most)
    size = math.ceil(count / parts)
    return [range(k, min(k + size, count)) for k in range(0, count, size)]
