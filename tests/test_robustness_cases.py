"""The extreme cases: the same in every run, and possible designs."""

from studies.validation import robustness_cases


def test_samples_are_the_same_in_every_run_and_can_be_made():
    for one, other in zip(robustness_cases.cases(), robustness_cases.cases(), strict=True):
        assert (one.name, one.changes, one.loads) == (other.name, other.changes, other.loads)
        if one.name.startswith("sample"):
            assert 0 < one.loads[-1].depth < one.design.L - one.design.magnet_height
