"""SCALE.md: goals that are met and missed, and the figures of each case."""

from studies.benchmarks.sweep_report import Figure, report


def test_the_page_says_which_goals_are_met():
    figures = [Figure("presses", "time", 12.34, "s", 10.0), Figure("presses", "rows", 6480, "", 6000, more=True)]
    page = report([*figures, Figure("sizes", "task", 863, "bytes")], {"machine": "one"}, "command")
    assert "1 of 2 goals are met." in page
    assert "| presses: time | 12.3 s | at most 10 s | **no** |" in page
    assert "| presses: rows | 6480 | at least 6000 | yes |" in page
    assert "## Sizes\n\n| figure | measured |\n| --- | --- |\n| task | 863 bytes |" in page
    assert "- machine: one" in page


def test_a_figure_without_a_goal_is_neither_met_nor_missed():
    assert Figure("sizes", "task", 863, "bytes").row()["met"] is None
