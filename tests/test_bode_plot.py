"""The Bode plot: each element keeps its look, silent elements are named, and peaks have their full height."""

import numpy as np
import pytest

from analytic.oscillator import receptance
from studies.simulation import bode_plot, resonance_peaks
from studies.simulation.response_curves import Curves
from tests.picture_texts import check_texts, legend, saved_figures


def curves(reads, frequency):
    """Curves along x of a sensor that resonates at 340 Hz, of which the element k reads reads[k] V/mm."""
    shift = np.ones((len(frequency), 2), dtype=complex)
    force = 1 / receptance(frequency, 340.0, 1 + 0.02j)
    per_mm = shift[:, :1] * np.array(reads, dtype=complex)
    names = tuple(f"S{k + 1}" for k in range(len(reads)))
    return Curves(
        *("x", frequency, force, None, shift, shift[:, 0], names, ("V",) * len(reads)),
        *(per_mm, per_mm / force[:, None], None),
    )


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)

    def draw(reads, ladder=("mass on a spring with the silicone's branches",)):
        frequency = resonance_peaks.around([340.0], np.geomspace(1.0, 1000.0, 3))
        own = {name: receptance(frequency, 250.0, 1 + 0.1j) for name in ladder}
        bode_plot.draw(tmp_path / "bode.png", curves(reads, frequency), own)
        return figures.pop()

    return draw


def test_elements_that_read_nothing_are_named(drawn):
    figure = drawn([0.0, 0.2, 0.0])
    assert legend(figure) == ["S2", "no reading of a motion along x: S1, S3"]
    check_texts(figure)


def test_an_element_keeps_its_look_and_the_oscillators_have_others(drawn):
    figure = drawn([0.1, 0.3, 0.1], ("one", "two", "three", "four"))
    assert legend(figure) == ["S1", "S2", "S3"]
    looks = [{line.get_label(): line.get_color() for line in axis.get_lines()} for axis in figure.axes]
    assert looks[0] == looks[1]
    assert not set(looks[0].values()) & set(looks[2].values())
    assert set(looks[3].values()) == {looks[0]["S2"]}
    check_texts(figure)


def test_a_peak_between_the_frequencies_of_the_table_is_drawn_in_full(drawn):
    (line, _) = drawn([0.2]).axes[2].get_lines()
    slow, top = np.abs(receptance(np.array([1.0, 340.0]), 340.0, 1 + 0.02j))
    assert max(line.get_ydata()) == pytest.approx(top / slow, rel=1e-9)
