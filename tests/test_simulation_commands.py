"""The verbs stability and modes."""

from geometry.design import BadInput


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


def test_bad_modes_are_a_sentence(refusal):
    for tokens in (
        ("modes", "paper", "--count", 0),
        ("modes", "paper", "--depth", 8),
        ("stability", "paper", "--depth", 0),
    ):
        refusal(*tokens)


def test_a_press_that_stops_is_a_failed_solve_that_keeps_what_was_found(run, strict, monkeypatch):
    from fem.analyses import modes, small_shear, stability

    def stops(*_, **__):
        raise BadInput("the press stops at depth 6.2 mm: take a smaller depth")

    monkeypatch.setattr(stability, "critical", lambda *_, **__: stability.Critical(0.9, 1.0, 0.89, ""))
    monkeypatch.setattr(small_shear, "small_shear", stops)
    monkeypatch.setattr(modes, "modes", stops)
    for verb, kept in (("stability", "critical_depth_mm"), ("modes", "spring_mass_Hz")):
        status, out, err = run(verb, "paper", "--depth", 6.99, "--json")
        (record,) = strict(out)
        assert (status, record["status"] != "ok") == (3, True)
        assert record[kept] > 0
        assert "take a smaller depth" in record["message"]
        assert "take a smaller depth" in err


def test_only_modes_that_were_computed_are_claimed(run, strict):
    message = strict(run("modes", "paper", "--count", 1, "--accuracy", "quick", "--json")[1])[0]["message"]
    assert "possibly more" in message


def test_stiffness_beyond_the_critical_depth_says_so(monkeypatch):
    from fem.analyses import small_shear, stability
    from fem.solution import Estimates
    from geometry.design import paper
    from studies.simulation import critical_depths

    estimates = Estimates(depth=0.01, force=0.02)
    found = {
        False: stability.Critical(0.9, 1.0, 0.9, "", estimates),
        True: stability.Critical(None, None, 3.5, ""),
    }
    monkeypatch.setattr(stability, "critical", lambda *_, guided=False, **__: found[guided])
    monkeypatch.setattr(small_shear, "small_shear", lambda *_, **__: small_shear.SmallShear(1.0, 0.5, 0.1, 1.0, 1.0))
    below, beyond = (
        critical_depths.at_design(paper(), "rigid", "quick", depth, lambda *_: None) for depth in (0.5, 2.0)
    )
    (record,) = below.records
    assert record["message"] == ""
    assert (record["critical_depth_error_estimate"], record["critical_force_error_estimate"]) == (0.01, 0.02)
    assert record["guided_critical_depth_error_estimate"] is None
    assert "unstable" in beyond.records[0]["message"]
    assert below.shown[0].rows[0]["guided_critical_depth_mm"] == "none up to 3.5"


def test_a_search_that_stops_or_a_tip_that_gives_way_is_not_ok(monkeypatch):
    from fem.analyses import small_shear, stability
    from geometry.design import paper
    from studies.simulation import critical_depths

    def status(message, depth=None, stiffness=0.5):
        found = stability.Critical(None, None, 3.5, message)
        monkeypatch.setattr(stability, "critical", lambda *_, **__: found)
        shear = small_shear.SmallShear(stiffness, 0.5, 0.1, 1.0, 1.0)
        monkeypatch.setattr(small_shear, "small_shear", lambda *_, **__: shear)
        (record,) = critical_depths.at_design(paper(), "rigid", "quick", depth, lambda *_: None).records
        return record["status"], record["message"]

    assert status("")[0] == "ok"
    stopped = "the press does not converge beyond 3.5 mm"
    assert status(stopped) == ("unknown", stopped)
    assert [status("", depth)[0] for depth in (3.0, 4.0)] == ["ok", "unknown"]
    assert status("", 3.0, -0.5)[0] == "unstable"
