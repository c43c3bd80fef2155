"""Exit statuses that follow from goals."""

import math

import pytest

from studies.cli.command_output import report_goals
from studies.output.goals import Goal
from studies.output.result import FAILED, GOOD

MET = Goal("error", 0.5, 1.0, 3, "%")


@pytest.mark.parametrize(
    ("posed", "status", "said"),
    [
        ([MET], GOOD, ""),
        ([], FAILED, "Nothing was measured"),
        ([MET, Goal("error", 1.5, 1.0, 3, "%")], FAILED, "error: 1.5 %, goal at most 1 %"),
        ([Goal("error", math.nan, 1.0, 3)], FAILED, "error: no data"),
        ([Goal("error", None, 1.0, 3)], FAILED, "error: no data"),
        ([Goal("error", 0.0, 1.0, 0)], FAILED, "error: no data"),
        ([Goal("share", 0.9, 0.95, 3, at_least=True)], FAILED, "share: 0.9, goal at least 0.95"),
    ],
)
def test_a_goal_without_data_is_missed(posed, status, said, capsys):
    assert report_goals(posed) == status
    assert said in capsys.readouterr().err


def test_a_goal_without_a_bound_is_refused():
    with pytest.raises(ValueError, match="finite bound"):
        Goal("error", 0.0, math.inf, 1)
