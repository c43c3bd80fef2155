"""Failures that follow from goals."""

import math

import pytest

from studies.output.goals import Goal, failures

MET = Goal("error", 0.5, 1.0, 3, "%")


@pytest.mark.parametrize(
    ("posed", "said"),
    [
        ([MET], ""),
        ([], "Nothing was measured"),
        ([MET, Goal("error", 1.5, 1.0, 3, "%")], "error: 1.5 %, goal at most 1 %"),
        ([Goal("error", math.nan, 1.0, 3)], "error: no data"),
        ([Goal("error", None, 1.0, 3)], "error: no data"),
        ([Goal("error", 0.0, 1.0, 0)], "error: no data"),
        ([Goal("share", 0.9, 0.95, 3, at_least=True)], "share: 0.9, goal at least 0.95"),
    ],
)
def test_a_goal_without_data_is_missed(posed, said):
    assert (" ".join(failures(posed)) == "") == (said == "")
    assert said in " ".join(failures(posed))


def test_a_goal_without_a_bound_is_refused():
    with pytest.raises(ValueError, match="finite bound"):
        Goal("error", 0.0, math.inf, 1)
