"""The site: pages in docs, READMEs and results where they stand, and a reference that is made when the site is built.

The source of the site is the repository, so that every page has the links that it has there. `make docs` builds it.
"""

import itertools
import logging
import os
import re
import sys
from pathlib import Path

from sphinx import addnodes

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT)]

from docs import documented_commands, notebooks, reference_pages  # noqa: E402

project, author = "magtip", "magtip contributors"
version = release = reference_pages.version()
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "docs/index"
include_patterns = ["*.md", "*/README.md", "studies/**.md", "docs/**.md", "results/**.md"]
exclude_patterns = ["docs/verbs", ".*", "node_modules", "out", "tests", "**/__pycache__"]
html_theme = "furo"
html_title = f"magtip {version}"
html_additional_pages = {"index": "index.html"}
templates_path = ["templates"]
# it would make a dash of the hyphens of an option
smartquotes = False
html_copy_source = html_show_copyright = False
# a line of 100 characters, as the terminal prints it, is as wide as the text
html_theme_options = {"navigation_with_keys": True, "light_css_variables": {"code-font-size": "0.74rem"}}
default_role = "code"
myst_enable_extensions = ["deflist"]
myst_heading_anchors = 4
napoleon_use_param = napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"


def in_sections(app, what, name, obj, options, lines):
    """Write `a, b : words` as `a, b` above its words, since types are in the signature, and examples as a section.

    Attributes of a frozen dataclass are its parameters.
    """
    section, made = "", []
    for line, following in itertools.zip_longest(lines, lines[1:], fillvalue=""):
        if re.fullmatch("-{3,}", following.strip()):
            line = section = line.replace("Attributes", "Parameters")
        if line.startswith(">>>") and section != "Examples":
            section = "Examples"
            made += [section, "--------"]
        term = re.fullmatch(r"(\S[\w, *]*?) : (.+)", line) if section == "Parameters" else None
        made += [term[1], f"    {term[2]}"] if term else [line]
    lines[:] = made


def folders_as_text(app, doctree):
    """Show links to folders as text: the site has pages, pictures and files."""
    for link in list(doctree.findall(addnodes.pending_xref)):
        place = Path(app.env.doc2path(app.env.docname)).parent / str(link["reftarget"])
        if link["reftype"] == "myst" and place.is_dir() and not place.with_suffix(".md").exists():
            link.replace_self(link.children)


def drawn_pictures(app, docname, source):
    """Show the pictures that the blocks of a document have drawn, and let a tutorial be downloaded as a notebook."""
    path = Path(app.env.doc2path(docname))
    # the hand-written part of a verb's page is a page of its own in the repository only
    source[0] = re.sub(r"\]\(((?:\.\./)*(?:docs/)?)verbs/", r"](\1reference/verb/", source[0])
    run = documented_commands.PICTURES if path.parent == documented_commands.REFERENCE / "verb" else path
    if path in documented_commands.TUTORIALS:
        notebooks.write(path, documented_commands.REFERENCE)
        link = f"[Download this page as a notebook](../reference/{path.stem}.ipynb)."
        source[0] = source[0].replace("\n\n", f"\n\n{link}\n\n", 1)
    elif run != documented_commands.PICTURES:
        return
    folder = os.path.relpath(ROOT / "out" / "tutorials" / run.stem, path.parent)
    for name in documented_commands.pictures(run):
        source[0] = source[0].replace(f"]({name})", f"]({folder}/{name})")


def titles(app, docname, source):
    """Tell pages of one title apart: results in sub-folders by these, and the README from the site's first page."""
    head, path = source[0].partition("\n")[0], Path(app.env.doc2path(docname))
    alike = [each for each in (ROOT / "results").rglob("*.md") if each.read_text("utf-8").startswith(f"{head}\n")]
    if path == ROOT / "README.md":
        source[0] = source[0].replace(head, "# Overview", 1)
    elif path in alike and len(alike) > 1 and path.parent.parent != ROOT / "results":
        source[0] = source[0].replace(head, f"{head}: {path.parent.name.replace('_', ' ')}", 1)


def setup(app):
    logging.getLogger("skfem").setLevel(logging.WARNING)
    app.connect("builder-inited", lambda app: reference_pages.write())
    app.connect("autodoc-process-docstring", in_sections, priority=100)
    app.connect("source-read", titles)
    app.connect("source-read", drawn_pictures)
    app.connect("doctree-read", folders_as_text)
