"""What a verb asks of the finite elements: the store first, and what it lacks is solved here and kept.

The store holds all numbers of an answer by their names. The deformed body of a state is not among them: pictures and
files of it are made of a solve of their own (`simulation.load_cases`). Studies of many cases, which other processes
solve, ask by `solve_plan`, for the same paths.
"""

from __future__ import annotations

from collections.abc import Iterable

from studies.mechanics import path_solver
from studies.mechanics.path_solver import Answer, Place
from studies.mechanics.store import Store


def asked(place: Place, store: Store, values: Iterable[str] = ()) -> Answer:
    """Return the only answer of a path, for the design of its place.

    What failed because a process died is solved again.

    values : names that it must have; one that was stored without them is solved again.
    """
    state = store.states(place.content).get(place.at)
    if state is None or state.outcome == "transient" or path_solver.lacks(state, values):
        store.add(place.content, path_solver.solve_task(path_solver.task(1, place, [place.at])))
        # read as it is stored, so that it has the same digits the next time
        state = store.states(place.content)[place.at]
    design = place.scene.design
    answer = path_solver.answer(state, place.scene.accuracy.section_size)
    return answer.of(design.D, design.E_now, place.direction)
