"""How a text of the user enters a file that a program reads: TOML, Python, a comment, Markdown.

Names, columns, folders and command lines are the user's; written as they are, they would end a string, a comment, a
cell or a line. HTML escapes by itself: Jinja does it in pages (`page_templates`), `html.escape` in drawings.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

Scalar = str | float | bool

_MARKS = re.compile(r"""\\(?=[!-/:-@[-`{-~]|$) | [`*\[\]|] | <(?=[A-Za-z/!?]) | &(?=[A-Za-z\#])
                        | (?<![^\W_])_ | _(?![^\W_])""", re.VERBOSE)  # fmt: skip
"""What Markdown would read as a mark: also an underscore that is not between two letters or digits."""


def literal(value: Scalar | list[str]) -> str:
    r"""Return a value as TOML and Python both read it; numbers must be finite.

    >>> literal("x\"); import os\n"), literal(10.0)
    ('"x\\"); import os\\n"', '10.0')
    """
    # TOML takes no DEL and no surrogates, which ASCII alone would need
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


def toml(fields: Mapping[str, Scalar | list[str]]) -> list[str]:
    """Return the lines of TOML of these keys and values.

    >>> toml({"D": 10.0, "law": "yeoh"})
    ['D = 10.0', 'law = "yeoh"']
    """
    return [f"{key} = {literal(value)}" for key, value in fields.items()]


def one_line(text: str) -> str:
    r"""Return a text in which no letter ends a line or steers a terminal; such letters become question marks.

    >>> one_line("a\nb\x1b[2J")
    'a?b?[2J'
    """
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def is_text(name: str) -> bool:
    r"""Return whether a name is UTF-8: no text holds the letters by which Python stands for other bytes.

    >>> is_text("é"), is_text("\udcff")
    (True, False)
    """
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def in_comment(text: str) -> str:
    """Return a text for a comment of C, which it can neither end nor begin.

    >>> in_comment("x */ int evil; /*/")
    'x * / int evil; / * /'
    """
    return re.sub(r"/(?=\*)|\*(?=/)", r"\g<0> ", one_line(text))


def in_markdown(text: object) -> str:
    r"""Return a text as Markdown that shows it letter by letter, in a paragraph or in the cell of a table.

    >>> in_markdown("a|b `c` <script> _x_ force_z_N <= 5")
    'a\\|b \\`c\\` \\<script> \\_x\\_ force_z_N <= 5'
    """
    return _MARKS.sub(r"\\\g<0>", one_line(str(text)))


def as_code(text: str) -> str:
    """Return a text as a code span of Markdown, whatever backticks it has.

    >>> as_code("magtip --out a`b"), as_code("`a`")
    ('``magtip --out a`b``', '`` `a` ``')
    """
    clean = one_line(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", clean)), default=0))
    space = " " if clean.startswith("`") or clean.endswith("`") else ""
    return f"{fence}{space}{clean}{space}{fence}"
