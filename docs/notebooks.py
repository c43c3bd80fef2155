"""Notebooks of the tutorials, made from their Markdown when the site is built."""

import base64
import json
import re
from pathlib import Path

from docs.documented_commands import FENCE, Block, blocks

PICTURE = re.compile(r"!\[([^]]*)\]\(([^)]+)\)")
PAGE = re.compile(r"(?<!!)\[([^]]+)\]\((?!http)[^)]+\)")


def notebook(path: Path) -> dict[str, object]:
    """Return a tutorial as a notebook (nbformat 4.5): its text, its commands behind `!`, its snippets and files.

    Pictures that the commands draw are shown once they have run, all others are inside, and links to pages are text.
    """
    text, cells, end = path.read_text("utf-8"), [], 0
    found = {block.number: block for block in blocks(path)}
    # tables have the columns that the page shows, and no bar of progress is drawn over itself
    cells.append(code("%env COLUMNS=100\n%env TERM=dumb", "env: COLUMNS=100\nenv: TERM=dumb\n"))
    for number, fence in enumerate(FENCE.finditer(text)):
        cells += words(text[end : fence.start()], path)
        end = fence.end()
        if number in found:
            cells.append(of_block(found[number]))
    cells = [cells[1], cells[0], *cells[2:], *words(text[end:], path)]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def of_block(block: Block) -> dict[str, object]:
    if block.file:
        return code(f"%%writefile {block.file}\n{block.text.rstrip()}", f"Writing {block.file}\n")
    if block.kind == "python":
        return code(block.text.rstrip(), block.output or "")
    commands, outputs = zip(*block.commands, strict=True)
    return code("\n".join(f"!{command}" for command in commands), "".join(outputs))


def code(source: str, output: str) -> dict[str, object]:
    shown = [{"output_type": "stream", "name": "stdout", "text": output}] if output else []
    return {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": shown, "source": source}


def words(text: str, path: Path) -> list[dict[str, object]]:
    """Return a cell of text, or none; pictures that stand beside the page become a part of it."""
    attached = {}

    def inside(picture: re.Match[str]) -> str:
        place = path.parent / picture[2]
        if not place.exists():
            return picture[0]
        attached[f"{place.stem}.png"] = {"image/png": base64.b64encode(drawn(place)).decode()}
        return f"![{picture[1]}](attachment:{place.stem}.png)"

    source = PICTURE.sub(inside, PAGE.sub(r"\1", text)).strip()
    cell = {"cell_type": "markdown", "metadata": {}, "source": source} | (
        {"attachments": attached} if attached else {}
    )
    return [cell] if source else []


def drawn(place: Path) -> bytes:
    """Return a picture as PNG, since notebooks show no SVG that is attached."""
    if place.suffix != ".svg":
        return place.read_bytes()
    import vl_convert

    return vl_convert.svg_to_png(place.read_text("utf-8"), scale=1.5)


def write(path: Path, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{path.stem}.ipynb").write_text(json.dumps(notebook(path), indent=1), "utf-8")
