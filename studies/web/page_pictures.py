"""Pictures of a folder as data of the page, made smaller so that a report stays small."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path

from studies.web.folder_contents import Contents

WIDTH = 1100
"""Width of a picture in the page, pixels: that of the text on a screen with some reserve."""
COLOURS = 64


@dataclass(slots=True)
class Budget:
    """Bytes that pictures may still take."""

    left: int


def sources(contents: Contents, replaced: set[str], budget: Budget, remarks: list[str]) -> dict[str, str]:
    """Return the addresses (data:) of a folder's pictures by file name, without those that a figure replaces.

    Pictures that cannot be read, or for which no room is left, are named in `remarks`.
    """
    result = {}
    for name in contents.pictures:
        if name in replaced:
            continue
        try:
            source = _source(contents.path / name)
        except (OSError, ValueError) as error:
            remarks.append(f"{name} was not read: it is no picture ({str(error).splitlines()[0]}).")
            continue
        if len(source) > budget.left:
            remarks.append(f"{name} is not shown: the page would become too large.")
            continue
        budget.left -= len(source)
        result[name] = source
    return result


def _source(path: Path) -> str:
    """Return a picture as an address; one of pixels gets fewer of them, and fewer colours."""
    if path.suffix.lower() == ".svg":
        # as an image, an SVG file runs no script and loads nothing
        return f"data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}"
    from PIL import Image

    with Image.open(path) as picture:
        whole = picture.convert("RGBA")
    plain = Image.new("RGB", whole.size, "white")
    plain.paste(whole, mask=whole.getchannel("A"))
    if plain.width > WIDTH:
        plain = plain.resize((WIDTH, round(plain.height * WIDTH / plain.width)), Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    plain.quantize(COLOURS, dither=Image.Dither.NONE).save(stream, "PNG", optimize=True)
    return f"data:image/png;base64,{base64.b64encode(stream.getvalue()).decode()}"
