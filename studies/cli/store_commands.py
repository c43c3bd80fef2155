"""The actions of the verb store: list, export, check, prune."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from geometry.messages import Progress
from studies.cli.parameters import Call, verb
from studies.inputs.option_groups import Selection, Whole
from studies.output import atomic_files
from studies.output.records import FlatRow
from studies.output.result import Result, Table, collected, publish, show

LIMIT = 20
"""Number of rows of a list by default."""
NEEDED = ("model", "L_over_D", "depth_over_D", "shear_over_D", "status", "force_z_over_E_D2")
"""Columns that a list of states must show."""
NEEDED_OF_PATHS = ("model", "L_over_D", "states", "not_ok")
"""Columns that a list of paths must show."""


@verb("wide as_json")
def list_(call: Call, selection: Selection = Selection(), *, paths: bool = False, limit: Whole = LIMIT) -> int:
    """Show what the store holds, and its newest states that meet the filters.

    Parameters
    ----------
    paths
        Show a row for each path (the states of one dimensionless design, model and load) instead of each state.
    limit
        Largest number of rows, the newest first; 0 for all.
    """
    from studies.mechanics import store_actions

    if limit < 0:
        raise BadInput(f"--limit must be at least 0 (all rows); got {limit}")
    summary, rows = store_actions.listing(selection, limit, of_paths=paths)
    damaged = sum(row.get("status") == store_actions.DAMAGED for row in rows)
    remarks = []
    if not rows and summary["states_in_store"]:
        remarks.append("no state of the store meets the filters")
    if damaged:
        remarks.append(
            f"{damaged} of the listed states are not as they were written: magtip store check says what to do"
        )
    what = "paths" if paths else "states"
    table = Table(
        title=f"{len(rows)} of {summary[what]} {what}, the newest first",
        rows=_varying_first(rows),
        brief=("key",),
        first=NEEDED_OF_PATHS if paths else NEEDED,
    )
    whole = Table(title="Store", rows=[summary])
    result = Result(title="Store", records=[*whole.rows, *rows], shown=[whole, table], remarks=remarks)
    return show(result, call.screen)


def _varying_first(rows: list[FlatRow]) -> list[FlatRow]:
    constant = [key for key in (rows[0] if rows else ()) if len({row[key] for row in rows}) == 1]
    order = [*(key for key in (rows[0] if rows else ()) if key not in constant), *constant]
    return [{key: row[key] for key in order} for row in rows] if len(rows) > 1 else rows


@verb("as_json")
def export(
    call: Call,
    selection: Selection = Selection(),
    *,
    out: Annotated[Path, Parameter(help="Output file: .csv, .parquet or .jsonl.")],
) -> int:
    """Write the states that meet the filters as a table, lengths over D and forces over E D^2."""
    from studies.mechanics import store, store_actions

    file = selection.store or store.default()
    atomic_files.check_apart([out], [file])
    return publish(
        lambda progress: Result(
            title="Export",
            records=[{"file": str(out), "states": store_actions.export(selection, out, progress)}],
        ),
        call.screen,
    )


@verb("as_json")
def check(
    call: Call,
    *,
    store: Annotated[Path | None, Parameter(help="File of the store; default: the user's.")] = None,
    resolve: Whole = 0,
    seed: Whole = 0,
) -> int:
    """Check the store's file, contents, answers and physics versions; exit status 3 if a check fails.

    Parameters
    ----------
    resolve
        Solve this many states again, chosen at random, and compare them within the estimates of their errors.
    seed
        Number that fixes which states are chosen.
    """
    from studies.mechanics import store as user_store
    from studies.mechanics import store_check

    if resolve < 0:
        raise BadInput(f"--resolve must be at least 0; got {resolve}")

    def result(rows: list[FlatRow]) -> Result:
        failed = [f"{row['check']}: {row['message']}" for row in rows if row["status"] != "ok"]
        return Result(title="Check of the store", records=rows, failures=failed)

    def study(progress: Progress) -> Result:
        return collected(store_check.checks(store or user_store.default(), resolve, seed, progress), result)

    return publish(study, call.screen)


@verb("as_json")
def prune(call: Call, selection: Selection = Selection(), *, yes: bool = False) -> int:
    """Count the states that meet the filters; with --yes remove them and give their space back.

    Parameters
    ----------
    yes
        Remove the states.
    """
    from studies.mechanics import store_actions

    pruning = store_actions.prune(selection, yes=yes)
    remarks = ["nothing is removed yet: add --yes to remove these states"] if not yes and pruning["states"] else []
    title = "Removed" if yes else "To be removed"
    return show(Result(title=title, records=[pruning], remarks=remarks), call.screen)
