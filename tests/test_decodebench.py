"""The bench of the decoder on a few poses, and its report."""

from studies import decodebench, decodefiles

TWO = {name: decodebench.LAYOUTS[name] for name in ("paper (h 2, l0 7.2, c 2)", "h 4, l0 6, c 4")}


def test_small_run_keeps_its_goals(monkeypatch):
    monkeypatch.setattr(decodebench, "LAYOUTS", TWO)
    monkeypatch.setattr(decodebench, "TAUS", (0.2,))
    monkeypatch.setattr(decodebench, "STEPS", (0.5, 0.25))
    found = {
        "trips": decodebench.round_trips(200),
        "searches": decodebench.searches(2),
        "tables": decodebench.tables(100),
        "tilts": {"box": decodebench.ignored(decodebench.coder_of(decodebench.paper(), 0.2), 100)},
        "speed": [{"program": "NumPy", "layout": "a", "per_s": 7e4, "stream_Hz": 900.0}],
    }
    assert max(row["error_mm"] for row in found["trips"]) < decodefiles.TRIP_MM
    assert [row["ambiguous"] > 0.2 for row in found["trips"]] == [False, True]
    assert all(row["said"] == row["ambiguous"] and row["missed"] == 0 for row in found["searches"])
    coarse, fine = found["tables"]
    assert 0.3 < fine["median_mm"] / coarse["median_mm"] < 0.7
    assert found["tilts"]["box"]["median_mm"] > 0.01
    text = decodefiles.report(found, {"numpy": "2"}, decodebench.__doc__)
    assert "| a stream at 1000 Hz, NumPy | 900 | **no** |" in text
    assert "| 50000 decodings/s on one core, NumPy | 70000 | yes |" in text
