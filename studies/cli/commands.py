"""The verbs of the command `magtip`, and the exit statuses for everything that can end them.

Exit status: 0 success, 2 bad input (one sentence on standard error), 3 a solve or a check failed, 130 interrupted,
1 a bug. Functions import slow modules themselves, so that `magtip --help` is fast.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    Group,
    MissingArgumentError,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from geometry.bad_input import OutOfReach, SolveFailed
from geometry.design import BadInput
from studies.output import console
from studies.output.literals import is_text
from studies.output.result import BAD, BROKEN_PIPE, FAILED, GOOD, INTERRUPTED

NEGATIVE = re.compile(r"-[\d.]\S*[,%]|-$")
"""A negative percentage, the beginning of a list whose first number is negative, or - for a standard stream."""


def _version() -> str:
    from importlib.metadata import version

    return version("magtip")


app = App(
    name="magtip",
    help="Design soft magnetic three-axis force sensors by finite elements and formulas. Units: mm, N, MPa, T, V.",
    version=_version,
    # the list of verbs has no markup; only the help of a verb loads the Markdown library (0.04 s)
    help_format="plaintext",
    default_parameter=Parameter(negative=""),
    suppress_keyboard_interrupt=False,
)
GROUPS = ("Design", "Simulation", "Sensing", "Exploration", "Validation")
"""Groups of verbs in the order of `--help`; the functions with `@verb` in design_commands and so on are verbs."""
VALIDATION = Path(__file__).parents[1] / "validation"
"""Folder whose sub-packages are the verbs of `validate`."""


def _verbs(module: str) -> dict[str, str]:
    """Return the places of a module's functions that are verbs, by their names, without importing the module."""
    text = Path(__file__).with_name(f"{module}.py").read_text("utf-8")
    names = re.findall(r"^@verb\b[^@]*?^def (\w+)", text, re.MULTILINE)
    return {name: f"studies.cli.{module}:{name}" for name in names}


ACTIONS = {
    "Exploration": {
        "store": ("List, export, check and prune the stored states of all studies.", _verbs("store_commands")),
    },
    "Validation": {
        "validate": (
            "Run a study of how far the answers can be trusted, and what they cost.",
            {
                package.parent.name: f"studies.cli.validation_commands:{package.parent.name}"
                for package in sorted(VALIDATION.glob("*/__init__.py"))
            },
        ),
    },
}
"""Verbs with actions, in their groups: help, and the places of the functions that are the actions."""

for title in GROUPS:
    group = Group.create_ordered(title)
    verbs = _verbs(f"{title.lower()}_commands").values()
    for place, path in enumerate(verbs):
        # a path instead of a function: a command line then imports only the module of its own verb
        app.command(path, group=group, sort_key=place, help_format="markdown")
    for verb, (text, actions) in ACTIONS.get(title, {}).items():
        parts = App(name=verb, help=text, group=group, sort_key=len(verbs), default_parameter=app.default_parameter)
        parts.help_format = "plaintext"
        for place, action in enumerate(actions.values()):
            parts.command(action, sort_key=place, help_format="markdown")
        app.command(parts)
options = Group.create_ordered("Options")
for name in ("--help", "--version"):
    app[name].group = options


def _joined(tokens: list[str]) -> list[str]:
    """Join a value such as -1,0,0 or -1% to its option, because it would otherwise be read as an option.

    >>> _joined(["readings", "paper", "--shift", "-1,0,0", "--json"])
    ['readings', 'paper', '--shift=-1,0,0', '--json']
    """
    joined: list[str] = []
    for token in tokens:
        if joined and joined[-1].startswith("--") and "=" not in joined[-1] and NEGATIVE.match(token):
            joined[-1] += f"={token}"
        else:
            joined.append(token)
    return joined


def _unknown(error: UnknownOptionError) -> str:
    known = [name for argument in error.argument_collection for name in argument.names if name.startswith("--")]
    return _no_option(error.token.keyword or error.token.value, known)


def _no_option(option: str, known: list[str]) -> str:
    import difflib

    close = difflib.get_close_matches(option.strip("-"), [name.strip("-") for name in known], n=1)
    remedy = f"did you mean --{close[0]}?" if close else f"choose one of {', '.join(known)}"
    return f"there is no option {option}{f': {remedy}' if known else ''}"


def _moved(error: UnknownCommandError) -> str:
    """Return a sentence for a study, or a part of one, that was a verb of its own before; else that of the error."""
    words = list(error.root_input_tokens or [])
    word = words[1] if words[:1] == ["validate"] else words[0]
    if word in app["validate"]:
        return f"{word} is a study of validation: type magtip validate {word}"
    found = [path.parent.name for path in VALIDATION.glob("*/*.py") if path.stem.partition("_")[0] == word]
    if found:
        return f"{word} is a part of the study {found[0]}: type magtip validate {found[0]} {word}"
    return re.sub(r"\.\.\.$", "...; type magtip to see all", str(error))


def _missing(error: MissingArgumentError) -> str:
    verb = " ".join(error.command_chain or ())
    if error.keyword is not None or error.argument is None:
        tokens = [*(error.root_input_tokens or ()), ""]
        following = tokens[tokens.index(error.keyword) + 1] if error.keyword in tokens else ""
        # a value that begins with a minus is read as an option
        joined = f"{error.keyword}={following}" if re.match("-[^-]", following) else ""
        remedy = f"one that begins with a minus is written {joined}" if joined else "add it behind the option"
        return f"{verb}: {error.keyword} needs a value: {remedy}"
    name = error.argument.name
    surplus = [word.partition("=")[0] for word in error.unused_tokens or () if word.startswith("--")]
    if surplus and error.app:
        known = [each for one in error.app.assemble_argument_collection() for each in one.names]
        return _no_option(surplus[0], known)
    if name.startswith("--"):
        return f"{verb} needs {name}: add {name} and its value"
    about = re.split(r"\.(?:\s|$)", error.argument.parameter.help or "", maxsplit=1)[0]
    about = about if about[1:2].isupper() else about[:1].lower() + about[1:]
    return f"{verb} needs {name}: add it behind the verb. It is: {about}"


def _no_number(error: CoercionError) -> str:
    token, number = error.token, re.compile(r"[-+]?[\d.]+ ?[^\d\s,:.][^\d,:]*")
    if error.target_type is not float or token is None or not number.fullmatch(token.value):
        return str(error)
    return f"{token.keyword} takes a number alone, in the unit that its help names; got {token.value!r}"


def _unused(error: UnusedCliTokensError) -> str:
    verb, chain = app, error.command_chain or ()
    for name in chain:
        verb = verb[name]
    named = [each.name for each in verb.assemble_argument_collection() if each.index is not None]
    taken = f"one {' and one '.join(named)} and options" if named else "options only"
    surplus = ", ".join(map(repr, error.unused_tokens or []))
    return f"{' '.join(chain) or 'magtip'} takes {taken}: leave out {surplus}, or quote a value that has spaces"


ARGUMENT = re.compile(r"`([a-z]+(?:_[a-z]+)*)`")
"""A name in backticks in a message: an argument for callers from Python, which is an option here."""


def as_options(message: str) -> str:
    """Return a message for the command line.

    >>> as_options("name another file by `store`, or leave `retry_failed` out: `magtip store check` says why")
    'name another file by --store, or leave --retry-failed out: `magtip store check` says why'
    """
    return ARGUMENT.sub(lambda found: f"--{found[1].replace('_', '-')}", message)


REMEDIES: dict[type[Exception], Callable[[Any], str]] = {
    CoercionError: _no_number,
    UnknownCommandError: _moved,
    UnknownOptionError: _unknown,
    MissingArgumentError: _missing,
    UnusedCliTokensError: _unused,
}


TO_TRY = {
    "magtip solve paper --depth 1": "press the paper's sensor by 1 mm",
    "magtip explore paper": "change it by hand, on a live page",
    "magtip compare paper": "its formulas beside finite elements",
    "magtip size --example > mine.toml": "state your forces, then size mine.toml",
    "magtip cad paper --out cad": "its mould, base, drawings and recipe",
}
"""Commands for who types none, with what each does."""

SPACE, PLACE = "make space on its disk, or choose another folder", "choose another folder"
RIGHTS, NAME = "change its permissions, or choose another folder", "choose another name"
OF_FILES: dict[int | None, str] = {
    errno.ENOSPC: SPACE, errno.EDQUOT: SPACE, errno.EFBIG: SPACE, errno.EACCES: RIGHTS, errno.EPERM: RIGHTS,
    errno.EROFS: PLACE, errno.ENOENT: PLACE, errno.ENXIO: PLACE, errno.EIO: PLACE, errno.ESTALE: PLACE,
    errno.EISDIR: NAME, errno.ENOTDIR: NAME, errno.EEXIST: NAME, errno.ENOTEMPTY: NAME, errno.ENAMETOOLONG: NAME,
    errno.ELOOP: NAME, errno.ETXTBSY: NAME, errno.EBUSY: NAME,
}  # fmt: skip
"""Remedies for what the system says of files; any other error of the system is a bug."""


def run(tokens: list[str] | None = None) -> int:
    """Run one command line (default: that of the process) and return its exit status."""
    console.complete_streams()
    words = _joined(sys.argv[1:] if tokens is None else tokens)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    for before, word in zip(["", *words], words, strict=False):
        if not word or (word.startswith("--") and word.endswith("=") and word.count("=") == 1):
            name = word.removesuffix("=") or (before if before.startswith("--") else "an argument")
            console.say(f"magtip: {name} is empty: give it a value, or leave it out")
            return BAD
        if not is_text(word):
            console.say(f"magtip: {word!a} is not UTF-8: rename the file or folder, or type the value again")
            return BAD
    try:
        with contextlib.redirect_stdout(console.Output(sys.stdout)), console.warnings_once():
            listed = app[words[0]] if any(words[:1] == [verb] for each in ACTIONS.values() for verb in each) else app
            # import all verbs or actions: their list shows only the name of one that is not imported
            if all(word.startswith("-") for word in words[listed is not app :][:1]):
                list(map(listed.__getitem__, listed))
            status = app(words, exit_on_error=False, print_error=False, result_action="return_value")
            if not words:
                print("Five things to try:", *(f"  {line:35}{text}" for line, text in TO_TRY.items()), sep="\n")
            sys.stdout.flush()
    except (BadInput, CycloptsError) as error:
        sentence = REMEDIES.get(type(error), str)(error)
        console.say(f"magtip: {as_options(sentence)}")
        return FAILED if isinstance(error, OutOfReach) else BAD
    except SolveFailed as error:
        console.say(f"magtip: {error}")
        return FAILED
    except console.OutputLost as error:
        console.drop_stream(sys.stdout)
        if error.errno == errno.EPIPE:
            return BROKEN_PIPE
        console.say(f"magtip: cannot write to standard output ({error.strerror}): redirect it elsewhere")
        return BAD
    except OSError as error:
        if error.errno not in OF_FILES:
            raise
        name = repr(error.filename) if error.filename else "a file"
        console.say(f"magtip: cannot write or read {name} ({error.strerror or error}): {OF_FILES[error.errno]}")
        return BAD
    except KeyboardInterrupt as stop:
        console.say(f"magtip: interrupted; {str(stop) or 'any complete files are kept'}")
        if tokens is None and console.loaded():
            # all files are closed; Python's own exit would only wait seconds for imports that still run
            with contextlib.suppress(OSError):
                sys.stdout.flush()
            os._exit(INTERRUPTED)
        return INTERRUPTED
    return int(status or GOOD)
