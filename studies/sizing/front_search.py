"""Search for a Pareto front by NSGA-II, with continuous variables and choices from lists.

Selection, crossover, mutation and survival are pymoo's; the seed fixes the front to the last bit. Constraints follow
Deb's rule: a feasible candidate is better than an infeasible one, and of two infeasible ones the one with the smaller
sum of violations.

Deb, Pratap, Agarwal, Meyarivan, IEEE Trans. Evol. Comput. 6 (2002) 182.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array, Ints
from geometry.messages import Progress

if TYPE_CHECKING:
    from pymoo.core.population import Population
    from pymoo.core.problem import Problem

CHOICE_MUTATION = 0.1
"""Share of offspring in which a choice is replaced by a random one. pymoo's default for one variable is 0.5, with
which half of all good choices are lost in each generation."""

POOL = 6
"""Random candidates from which the first generation is chosen, over its size: where few candidates are feasible, the
first good ones decide around which choices the search goes on."""

Evaluate = Callable[[Array], tuple[Array, Array]]
"""Returns objectives (n, k), all to be made small, and constraints (n, q), met where <= 0, of n candidates (n, m)."""


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the search: a number from `low` to `high`, or one of `choices` choices, numbered from 0.

    Of `ordered` choices, neighbours are alike: offspring then take choices near those of their parents.
    """

    name: str
    low: float = 0.0
    high: float = 1.0
    choices: int = 0
    ordered: bool = False


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to search: number of candidates in a generation, number of generations, seed of the random numbers."""

    population: int = 128
    generations: int = 150
    seed: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class Generation:
    """A population of n candidates.

    Attributes
    ----------
    number : number of this generation; 0 is the random one.
    X : values of the variables, shape (n, m); choices as numbers.
    F, G : objectives, shape (n, k), and constraints, shape (n, q).
    rank, crowding : of NSGA-II, shape (n,); NaN for infeasible candidates.
    """

    number: int
    X: Array
    F: Array
    G: Array
    rank: Array
    crowding: Array

    @property
    def front(self) -> Ints:
        """Indices of the feasible candidates that no other dominates, in the order of the first objective."""
        chosen = np.flatnonzero((self.rank == 0) & (self.G <= 0).all(axis=1))
        return chosen[np.argsort(self.F[chosen, 0], kind="stable")]


def search(
    variables: Sequence[Variable],
    evaluate: Evaluate,
    effort: Effort = Effort(),
    *,
    progress: Progress | None = None,
) -> Generation:
    """Return the last generation of a search."""
    random = np.random.default_rng(effort.seed)
    state = _first(variables, evaluate, effort, random)
    while state.number < effort.generations:
        if progress is not None:
            feasible = int((state.G <= 0).all(axis=1).sum())
            progress(state.number / effort.generations, f"generation {state.number}, {feasible} feasible")
        state = _next(variables, evaluate, state, random)
    return state


def _first(
    variables: Sequence[Variable], evaluate: Evaluate, effort: Effort, random: np.random.Generator
) -> Generation:
    """Return the best of a random pool: a Latin hypercube, so that each choice appears about equally often."""
    columns, count = [], POOL * effort.population
    for variable in variables:
        share = (random.permutation(count) + random.random(count)) / count
        if variable.choices:
            columns.append(np.floor(share * variable.choices))
        else:
            columns.append(variable.low + share * (variable.high - variable.low))
    X = np.column_stack(columns)
    F, G = evaluate(X)
    return _survivors(variables, X, F, G, effort.population, random, 0)


def _next(
    variables: Sequence[Variable], evaluate: Evaluate, state: Generation, random: np.random.Generator
) -> Generation:
    """Return the generation that follows: as many offspring as parents, of which the better half survives."""
    from pymoo.algorithms.moo.nsga2 import binary_tournament
    from pymoo.core.duplicate import NoDuplicateElimination
    from pymoo.core.mixed import MixedVariableMating
    from pymoo.core.variable import Choice, Integer, Real
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.crossover.ux import UX
    from pymoo.operators.mutation.pm import PM
    from pymoo.operators.mutation.rm import ChoiceRandomMutation
    from pymoo.operators.repair.rounding import RoundingRepair
    from pymoo.operators.selection.tournament import TournamentSelection

    mating = MixedVariableMating(
        selection=TournamentSelection(func_comp=binary_tournament),
        crossover={
            Real: SBX(eta=15, prob=0.9),
            Integer: SBX(eta=15, prob=0.9, vtype=float, repair=RoundingRepair()),
            Choice: UX(),
        },
        mutation={
            Real: PM(eta=20),
            Integer: PM(eta=10, vtype=float, repair=RoundingRepair()),
            Choice: ChoiceRandomMutation(prob_var=CHOICE_MUTATION),
        },
        eliminate_duplicates=NoDuplicateElimination(),
    )
    # binary_tournament reads these two from the algorithm
    rules = types.SimpleNamespace(tournament_type="comp_by_dom_and_crowding", random_state=random)
    parents = _population(variables, state.X, state.F, state.G, state.rank, state.crowding)
    children = mating.do(_problem(variables, state), parents, len(parents), random_state=random, algorithm=rules).get(
        "X"
    )
    X = np.array([[float(child[variable.name]) for variable in variables] for child in children])
    # a candidate that exists already would only take the place of another one; pymoo, which compares pair by pair,
    # would need more time for this than for all the rest
    merged = np.concatenate([state.X, X])
    new = np.sort(np.unique(merged, axis=0, return_index=True)[1])
    new = new[new >= len(state.X)]
    F, G = evaluate(merged[new])
    return _survivors(
        variables,
        np.concatenate([state.X, merged[new]]),
        np.concatenate([state.F, F]),
        np.concatenate([state.G, G]),
        len(parents),
        random,
        state.number + 1,
    )


def _survivors(
    variables: Sequence[Variable], X: Array, F: Array, G: Array, count: int, random: np.random.Generator, number: int
) -> Generation:
    """Return the best candidates as a generation."""
    from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

    missing = np.full(len(X), np.nan)
    population = _population(variables, X, F, G, missing, missing)
    problem = _problem(variables, Generation(number, X, F, G, missing, missing))
    chosen = RankAndCrowding().do(problem, population, n_survive=count, random_state=random)
    index, rank, crowding = (chosen.get(name).astype(np.float64) for name in ("index", "rank", "crowding"))
    at = index.astype(np.int64)
    return Generation(number, X[at], F[at], G[at], rank, crowding)


def _population(
    variables: Sequence[Variable], X: Array, F: Array, G: Array, rank: Array, crowding: Array
) -> Population:
    """Return candidates as pymoo holds them; each knows its index."""
    from pymoo.core.population import Population

    values = [
        {each.name: int(value) if each.choices else float(value) for each, value in zip(variables, row, strict=True)}
        for row in X
    ]
    population = Population.new(X=values, F=F, G=G)
    population.set("rank", rank, "crowding", crowding, "index", np.arange(len(X)))
    return population


def _problem(variables: Sequence[Variable], state: Generation) -> Problem:
    """Return the variables, and the numbers of objectives and constraints, as pymoo describes them."""
    from pymoo.core.problem import Problem
    from pymoo.core.variable import Choice, Integer, Real

    def kind(each: Variable) -> object:
        if not each.choices:
            return Real(bounds=(each.low, each.high))
        last = each.choices - 1
        return Integer(bounds=(0, last)) if each.ordered and last else Choice(options=list(range(last + 1)))

    kinds = {each.name: kind(each) for each in variables}
    return Problem(vars=kinds, n_obj=state.F.shape[1], n_ieq_constr=state.G.shape[1])
