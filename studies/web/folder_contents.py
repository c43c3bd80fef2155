"""What a folder of results holds: tables, pages, pictures, solutions, designs and the record of the run.

Files are recognised by name and content; what cannot be read is named with the reason, and spoils nothing else.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.design import BadInput, Design
from geometry.loads import ANSWERED
from studies.inputs import table_input, user_input
from studies.output import own_files, provenance
from studies.output.bounded_files import LARGEST, MOST_BYTES, MOST_ROWS, json_object, text_of
from studies.output.literals import is_text
from studies.parts.requirements import Requirements, stated_requirements

if TYPE_CHECKING:
    import pandas as pd

IGNORED = (".stl", ".step", ".3mf", ".dxf", ".zip", ".kicad_pcb", ".kicad_pro", ".kicad_sch", ".npz", ".html")
"""Suffixes of files that are no results to show: solids, drawings, boards for machines, states of a search, pages."""
PICTURES = (".png", ".svg")
SIZING = "sizing.json"
"""Record of a sizing, whose version counts."""
MOST_FOLDERS = 200
"""Number of sub-folders beyond which a folder is no folder of results: somebody's home, for instance."""


def answered(table: pd.DataFrame) -> NDArray[np.bool_]:
    """Return whether each row succeeded; a table without a status has only such rows."""
    known = table["status"].isin(ANSWERED) if "status" in table else np.ones(len(table))
    return np.asarray(known, dtype=np.bool_)


@dataclass(slots=True)
class Contents:
    """What one folder holds, without its sub-folders.

    Attributes
    ----------
    name : its path below the folder of the report; "" for that folder itself.
    tables, texts, records, pages, designs : by file name; a column whose cells are all numbers or empty holds
        numbers, a text is that of a CSV file, a page is Markdown, a record an object of a JSON file.
    requirements : of the design files that state some, by file name.
    pictures, solutions : file names.
    run : record of the command that made the folder; None where there is none.
    unread : sentences on files that could not be read or that the report does not show.
    """

    path: Path
    name: str
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    records: dict[str, dict[str, Any]] = field(default_factory=dict)
    pages: dict[str, str] = field(default_factory=dict)
    designs: dict[str, Design] = field(default_factory=dict)
    requirements: dict[str, Requirements] = field(default_factory=dict)
    pictures: list[str] = field(default_factory=list)
    solutions: list[str] = field(default_factory=list)
    run: provenance.Run | None = None
    read: list[Path] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)

    @property
    def has_results(self) -> bool:
        """Whether there is more than pages of other origin, such as a user's README.md."""
        others = self.tables or self.records or self.pictures or self.solutions or self.designs
        return bool(others) or any(own_files.states_origin(self.path / name) for name in self.pages)


def read(root: Path) -> list[Contents]:
    """Read a folder, first, and its sub-folders, those with something to show; refuse one without results."""
    if not root.exists():
        raise BadInput(f"there is no folder {str(root)!r}: give a folder that a verb filled by --out")
    if not root.is_dir():
        raise BadInput(f"{str(root)!r} is a file: give the folder that holds it")
    contents = [_folder(path, root) for path in _folders(root)]
    if not any(folder.has_results for folder in contents):
        raise BadInput(
            f"the folder {str(root)!r} holds no results of magtip: give a folder that a verb filled by --out, such "
            "as magtip compare paper --out out/compare"
        )
    return [folder for folder in contents if folder.has_results or folder.pages or folder.unread]


def _folders(root: Path) -> Iterator[Path]:
    """Yield the folder and its sub-folders by name, without hidden ones."""
    for count, (path, names, _) in enumerate(os.walk(root)):
        names[:] = sorted(name for name in names if is_text(name) and not name.startswith((".", "__")))
        if count == MOST_FOLDERS:
            raise BadInput(
                f"the folder {str(root)!r} has more than {MOST_FOLDERS} sub-folders: give a folder of results"
            )
        yield Path(path)


def _folder(path: Path, root: Path) -> Contents:
    contents = Contents(path, "" if path == root else path.relative_to(root).as_posix())
    for file in sorted(path.iterdir()):
        if not is_text(file.name):
            contents.unread.append(f"{file.name!a} was not read: its name is not UTF-8: rename it.")
        elif file.is_file() and not file.name.startswith(".") and file.suffix.lower() not in IGNORED:
            try:
                _read_file(contents, file)
            except provenance.Newer as error:
                raise BadInput(str(error)) from None
            except BadInput as error:
                contents.unread.append(f"{file.name} was not read: {error}.")
    return contents


def _read_file(contents: Contents, file: Path) -> None:
    suffix, name = file.suffix.lower(), file.name
    contents.read.append(file)
    if name == provenance.NAME:
        contents.run = provenance.read(file)
    elif suffix == ".csv":
        contents.tables[name] = csv_table(file)
        contents.texts[name] = text_of(file, "CSV")
    elif suffix == ".parquet":
        contents.tables[name] = _parquet_table(file)
    elif suffix == ".jsonl":
        contents.tables[name] = states_table(file)
    elif suffix == ".json":
        contents.records[name] = _record(file)
    elif suffix == ".md":
        contents.pages[name] = text_of(file, "Markdown")
    elif suffix == ".toml":
        needed = stated_requirements(str(file))
        contents.designs[name] = user_input.read_design(str(file))
        if needed is not None:
            contents.requirements[name] = needed
    elif suffix in PICTURES:
        contents.pictures.append(name)
    elif suffix == ".vtu":
        contents.solutions.append(name)
    elif suffix in (".sqlite", ".db"):
        contents.unread.append(f"{name} is a store of solved states: magtip store list --store {name} shows it.")
    else:
        contents.unread.append(f"{name} is not shown: the report does not know files that end in {suffix or name!r}.")


def csv_table(file: Path) -> pd.DataFrame:
    import pandas as pd

    rows = table_input.csv_rows(file)
    if not rows:
        raise BadInput(f"{file.name} is empty")
    head = [cell.strip() for cell in rows[0][1]]
    for line, row in rows[1:]:
        table_input.check_length(file, line, head, row)
    columns = {name: column_of([row[k] for _, row in rows[1:]]) for k, name in enumerate(head)}
    for name, values in columns.items():
        if values.dtype != object and (np.isfinite(values) & (np.abs(values) > LARGEST)).any():
            raise BadInput(f"column {name:.40} has a number beyond {LARGEST:g}")
    return pd.DataFrame(columns)


def column_of(cells: Sequence[str]) -> Any:
    """Return numbers where all cells are numbers or empty, else texts."""
    try:
        return np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        return np.array(cells, dtype=object)


def _parquet_table(file: Path) -> pd.DataFrame:
    import pandas as pd
    from pyarrow import ArrowException, parquet

    try:
        about = parquet.read_metadata(file)
        if about.num_rows > MOST_ROWS or about.num_rows * about.num_columns > MOST_BYTES // 8:
            raise BadInput(f"it has {about.num_rows} rows of {about.num_columns} columns, more than are read")
        return pd.read_parquet(file)
    except (OSError, ArrowException) as error:
        raise BadInput(f"it is no Parquet table ({str(error).splitlines()[0]})") from None


def states_table(file: Path) -> pd.DataFrame:
    """Read states that `solve --json` printed as a table; vectors become columns force_x_N, force_y_N, force_z_N."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for _, record in table_input.json_objects(file):
        row: dict[str, Any] = {}
        for key, value in record.items():
            if isinstance(value, list) and len(value) == 3 and key in ("force_N", "shift_mm"):
                name, unit = key.split("_")
                row |= {f"{name}_{way}_{unit}": part for way, part in zip("xyz", value, strict=True)}
            elif isinstance(value, (int, float, str)):
                row[key] = value
        rows.append(row)
    if not any(rows):
        raise BadInput(f"{file.name} is empty")
    return pd.DataFrame(rows)


def _record(file: Path) -> dict[str, Any]:
    record = json_object(file)
    # a JSON file of other origin may have a version of its own
    if file.name == SIZING:
        provenance.check_format(file, record)
    return record


def inputs(contents: Sequence[Contents]) -> list[Path]:
    """Return all files that were read."""
    return [file for folder in contents for file in folder.read]
