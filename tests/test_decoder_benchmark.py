"""The bench of the decoder on a few poses, and its report."""

import pytest

from geometry.design import BadInput
from studies.benchmarks import decoder_benchmark, decoder_report, lookup_benchmark

TWO = {name: decoder_benchmark.LAYOUTS[name] for name in ("paper (h 2, l0 7.2, c 2)", "h 4, l0 6, c 4")}


def test_a_table_in_a_file_is_measured(run, tmp_path):
    assert run("table", "paper", "--step", 0.25, "--out", "t.npy")[0] == 0
    whole = lookup_benchmark.whole(tmp_path / "t.npy", 50, 3)
    assert (whole.same, whole.figures.entries) == (3, 25 * 25 * 13)
    assert 0.1 < whole.figures.median_mm < 0.2 < whole.figures.worst_mm
    assert "made again" in "".join(decoder_report._full(whole))
    assert run("table", "paper", "--step", 0.5, "--set", "l0=8", "--out", "u.npy")[0] == 0
    for name, words in (("u.npy", "another sensor, with l0 8 mm"), ("missing.npy", "is not a table")):
        with pytest.raises(BadInput, match=words):
            lookup_benchmark.whole(tmp_path / name)


def test_small_run_keeps_its_goals(monkeypatch):
    monkeypatch.setattr(decoder_benchmark, "LAYOUTS", TWO)
    monkeypatch.setattr(decoder_benchmark, "TAUS", (0.2,))
    monkeypatch.setattr(lookup_benchmark, "STEPS", (0.5, 0.25))
    tilt = decoder_benchmark.ignored(decoder_benchmark.coder_of(decoder_benchmark.paper(), 0.2), 100)
    measured = decoder_report.Measurements(
        trips=decoder_benchmark.round_trips(200),
        searches=decoder_benchmark.searches(2),
        tables=lookup_benchmark.steps(100),
        whole=None,
        tilts={"box": tilt},
        law=None,
        speed=[decoder_report.DecoderSpeed("NumPy", "a", per_s=7e4, stream_Hz=900.0)],
    )
    assert max(trips.error_mm for trips in measured.trips) < decoder_report.TRIP_MM
    assert [trips.ambiguous > 0.2 for trips in measured.trips] == [False, True]
    assert all(search.said == search.ambiguous and search.missed == 0 for search in measured.searches)
    coarse, fine = measured.tables
    assert 0.3 < fine.median_mm / coarse.median_mm < 0.7
    assert tilt.median_mm > 0.01
    text = decoder_report.report(measured, {"numpy": "2"}, decoder_benchmark.ABOUT)
    assert "| a stream at 1000 Hz, NumPy | 900 | **no** |" in text
    assert "| 50000 decodings/s on one core, NumPy | 70000 | yes |" in text
