"""The estimated time that is left, against tasks of known times on simulated workers."""

import heapq
import math
import random

import pytest

from studies.mechanics.time_left import Unfinished, clock_text


def estimates(costs, seconds, workers):
    """Do tasks of known times with a simulated clock.

    Returns the share of the work that is done, the estimate and the true time left after each task.
    """
    now = 0.0
    unfinished = Unfinished(list(costs), clock=lambda: now)
    unfinished.occupy(workers)
    running, waiting, states = [], list(enumerate(seconds)), []
    while running or waiting:
        while waiting and len(running) < workers:
            number, duration = waiting.pop(0)
            heapq.heappush(running, (now + duration, number, duration))
        now, number, duration = heapq.heappop(running)
        unfinished.finish(number, duration)
        unfinished.occupy(workers)
        states.append((unfinished.share, unfinished.seconds_left(), now))
    return [(share, left, now - then) for share, left, then in states]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("workers", [1, 2, 8])
@pytest.mark.parametrize("kind", ["equal", "growing", "shrinking", "mixed"])
def test_after_a_fifth_of_the_work_the_estimate_is_right_within_a_factor_of_1_5(kind, workers, seed):
    """Costs are in a unit of their own, and times scatter about them with a standard deviation of 25 %."""
    draw, count = random.Random(seed), 36 * workers
    costs = {
        "equal": [1.0] * count,
        "growing": [1.0 + 10 * k / count for k in range(count)],
        "shrinking": [11.0 - 10 * k / count for k in range(count)],
        "mixed": [draw.choice([1.0, 2.0, 10.0]) for _ in range(count)],
    }[kind]
    seconds = [7.3 * cost * math.exp(draw.gauss(0, 0.25)) for cost in costs]
    compared = [left / truth for share, left, truth in estimates(costs, seconds, workers) if 0.2 <= share <= 0.6]
    assert len(compared) > 2 * workers
    assert min(compared) > 1 / 1.5
    assert max(compared) < 1.5


def test_costs_that_are_exact_but_for_a_factor_give_the_exact_time():
    states = estimates([3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0], [1.5, 0.5, 2.0, 0.5, 2.5, 4.5, 1.0, 3.0], 2)
    assert [left for _, left, _ in states] == pytest.approx([truth for _, _, truth in states])


def test_a_long_last_task_is_waited_for():
    unfinished = Unfinished([1.0, 1.0, 1.0, 30.0], clock=lambda: 0.0)
    unfinished.occupy(2)
    unfinished.finish(0, 2.0)
    assert unfinished.seconds_left() == 62.0


def test_before_the_first_answer_there_is_no_estimate():
    unfinished = Unfinished([1.0, 1.0])
    unfinished.occupy(1)
    unfinished.finish(0, math.nan)
    assert math.isnan(unfinished.seconds_left())
    assert unfinished.share == 0.5


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "0:00"), (59.7, "1:00"), (3599.8, "1:00:00"), (90061, "25:01:01")]
)
def test_a_time_is_written_as_by_a_clock(seconds, text):
    assert clock_text(seconds) == text
