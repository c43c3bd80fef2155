"""What the study of the range does with a design: some ends, and a step that fails."""

from dataclasses import replace

import pytest

from studies.validation import design_range, design_range_steps


@pytest.mark.parametrize(("number", "ending"), [(3, "impossible"), (20, "ok"), (21, "ok")])
def test_some_designs(number, ending, tmp_path):
    """A stem too short for its magnet, a small disc in a beam of 50 mm, one close to the base."""
    result = design_range_steps.examine(number, design_range.samples(number + 1)[number], tmp_path)
    assert result.status == ending
    if ending == "impossible":
        assert "needs at least 0.1 mm: take a smaller magnet" in result.message
        return
    assert (result.section, result.solid_mesh) == ("ok", "ok")
    assert result.solids == "ok" or result.message
    assert result.cached_ms < 100
    assert result.least_jacobian > 0.04


def test_a_step_that_fails_is_told_and_the_others_go_on(monkeypatch, tmp_path):
    def broken(design, result):
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(design_range_steps, "_solids", broken)
    monkeypatch.setattr(
        design_range_steps, "_solid_mesh", lambda design, result, cache: replace(result, tetrahedra=7)
    )
    result = design_range_steps.examine(18, design_range.samples(19)[18], tmp_path)
    assert (result.status, result.solids, result.section, result.tetrahedra) == ("failed", "failed", "ok", 7)
    assert result.message == "solids: ZeroDivisionError: of the test"
