"""The verbs stability and modes."""


def test_stability_says_when_and_how_stiff(run, strict):
    status, out, _ = run("stability", "paper", "--set", "L=24", "--depth", 0.5, "--accuracy", "quick", "--json")
    assert status == 0
    (record,) = strict(out)
    assert 0.8 < record["critical_depth_mm"] < 0.95
    assert record["guided_critical_depth_mm"] is None or record["guided_critical_depth_mm"] > 1.5
    assert record["stiffness_N_per_mm"] > 0
    assert 0 < record["shift_per_mm"] < 1
    assert 0 < record["tilt_rad_per_mm"] < 0.2


def test_modes_are_named_and_judged(run, strict):
    status, out, _ = run("modes", "paper", "--count", 4, "--accuracy", "quick", "--json")
    assert status == 0
    (record,) = strict(out)
    assert record["shape"] == ["bending", "torsion", "axial", "bending"]
    assert record["frequency_Hz"] == sorted(record["frequency_Hz"])
    assert "bending" in record["message"]


def test_bad_modes_are_a_sentence(run):
    for tokens in (
        ("modes", "paper", "--count", 0),
        ("modes", "paper", "--depth", 8),
        ("stability", "paper", "--depth", 0),
    ):
        status, out, err = run(*tokens)
        assert (status, out, err.count("\n")) == (2, "", 1)
