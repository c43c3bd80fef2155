"""The verb of the live page: explore."""

from __future__ import annotations

import tempfile
from pathlib import Path

from geometry.design import BadInput, Design
from studies.cli.parameters import Sets, Source, design_of
from studies.inputs.option_groups import Whole
from studies.output import atomic_files, console
from studies.output.result import GOOD


def explore(
    source: Source = "paper",
    /,
    *,
    port: Whole = 0,
    no_browser: bool = False,
    export: Path | None = None,
    sets: Sets = None,
) -> int:
    """Open a page on which a sensor and its load are changed by hand, solved by finite elements meanwhile.

    The page is served to this computer only, until Ctrl-C, and works without a network.

    Parameters
    ----------
    port
        Port of the page; default: any free one.
    no_browser
        Print the address of the page, but do not open it.
    export
        Write the page of this one design as a file (.html) that needs no server: depth, shear and direction move
        between states that are solved beforehand, in a minute or more.
    """
    if export is not None and (port or no_browser):
        option = "--port" if port else "--no-browser"
        raise BadInput(f"--export writes a file without a server, for which {option} has no meaning: leave it out")
    design = design_of(source, sets)
    if export is not None:
        _export(design, export)
        return GOOD
    from studies.explorer import explorer_server, state_commands

    with tempfile.TemporaryDirectory(prefix="magtip-") as folder:

        def ready(address: str) -> None:
            print(f"{address}\n", end="", flush=True)
            console.note("The address is for this user of this computer only. Ctrl-C ends the explorer.")
            if not no_browser:
                _open(address, Path(folder, "explorer.html"))

        explorer_server.serve(state_commands.address_fields(design), port, ready)
    return GOOD


def _export(design: Design, path: Path) -> None:
    """Write the page of a design as one file."""
    from studies.explorer import offline_page

    file = atomic_files.check_output_file(path, ".html", ".htm")
    with console.progress(as_json=False) as progress:
        offline_page.write(design, file, progress)
    console.note(f"{file}: open it in a browser; it needs no server and no network")


def _open(address: str, file: Path) -> None:
    """Open the page in the user's browser; say what to do if there is none.

    All users see the command lines of processes, and the address holds the token: the browser gets it from a file in
    a folder that only this user may read.
    """
    import html
    import webbrowser

    link = html.escape(address)
    file.write_text(
        f'<!DOCTYPE html>\n<meta charset="utf-8">\n<meta http-equiv="refresh" content="0; url={link}">\n'
        f'<title>magtip explore</title>\n<a href="{link}">magtip explore</a>\n',
        encoding="utf-8",
    )
    if webbrowser.open(file.as_uri()):
        console.note("If your browser shows no sensor, open the address in it.")
    else:
        console.note("No browser was found: open the address in one.")
