"""The temperature of a design: what it does to modulus, field and readings, and that every model takes it."""

import dataclasses
import json
import math
import sqlite3

import numpy as np
import pandas as pd
import pytest

import magtip
from analytic import beam, buckling, hall
from analytic.decode import decode, decoder
from fem.accuracy import QUICK
from fem.analyses.modes import modes
from fem.equilibrium import solve
from geometry import design_digest
from geometry.design import Design, paper
from geometry.loads import Load, tip_compliance
from geometry.relaxation import moduli
from studies.beam import surrogate_response
from studies.sensing.decode_readings import of_level

WARM = 60.0
RUBBER, MAGNET, GAIN = (WARM + 273.15) / 293.15, 1 - 0.0012 * 40, 1 + 2e-4 * 40
"""What 40 K above 20 C do to a rubber, to NdFeB and to an SS495A."""
STUCK = Load(1.0, 0.5, friction="stick")


def warmed(design=paper()):
    return dataclasses.replace(design, temperature=WARM)


def ratio(of):
    """Return what a function gives for the warm sensor of the paper over what it gives at 20 C."""
    return of(warmed()) / of(paper())


@pytest.mark.parametrize(
    ("of", "power"),
    [
        *((lambda d, level=level: beam.solve(d, STUCK, level).force[2], 1.0) for level in beam.LEVELS),
        *((lambda d, level=level: beam.solve(d, STUCK, level).force[0], 1.0) for level in beam.LEVELS),
        (lambda d: solve(d, Load(depth=0.1), QUICK).response.force[2], 1.0),
        (lambda d: surrogate_response.respond(d, STUCK).response.force[2], 1.0),
        (buckling.euler, 1.0),
        (tip_compliance, -1.0),
        (lambda d: moduli(d)[0], 1.0),
        (lambda d: modes(d, count=1, accuracy=QUICK, estimate=False).frequency[0], 0.5),
    ],
)
def test_mechanics_are_those_of_a_rubber_s_modulus(of, power):
    """Forces are proportional to the absolute temperature, frequencies to its root; poses do not change."""
    assert ratio(of) == pytest.approx(RUBBER**power, rel=1e-9)


def test_poses_do_not_change():
    cold, warm = (solve(design, Load(depth=0.1), QUICK).response for design in (paper(), warmed()))
    assert warm.shift == pytest.approx(cold.shift, rel=1e-9)


def test_the_field_falls_with_the_remanence_and_the_output_with_the_gain_too():
    cold, warm = (hall.readings(design, shift=(0.3, 0.0, -0.5)) for design in (paper(), warmed()))
    assert pytest.approx(np.multiply(MAGNET, cold.B_T), rel=1e-12) == warm.B_T
    assert np.subtract(warm.V, 2.5) == pytest.approx(MAGNET * GAIN * np.subtract(cold.V, 2.5), rel=1e-12)


@pytest.mark.parametrize(("layout", "far"), [("tmag5273a1", "by up to 2 %"), ("mlx90393", "by an unknown amount")])
def test_a_chip_whose_gain_may_drift_to_either_side_keeps_it_with_a_warning(layout, far):
    warm = Design(hall_layout=layout, temperature=WARM)
    assert warm.hall_gain_now == 1.0
    said = f"may have drifted {far} to either side at {WARM:g} C"
    assert any(said in text for text in warm.value_warnings())
    assert not any("drifted" in text for text in Design(hall_layout=layout).value_warnings())


def test_a_hot_magnet_is_warned_of_and_a_temperature_beyond_silicone_refused():
    assert any("standard grades of NdFeB" in text for text in paper(temperature=100.0).value_warnings())
    assert not paper(temperature=80.0).value_warnings()
    with pytest.raises(magtip.BadInput, match="temperature must lie between -40 and 200 degC; got 250 degC"):
        paper(temperature=250.0)


def test_readings_of_a_warm_sensor_decode_to_its_force():
    design = warmed()
    law = of_level(design, "finite")
    made = decoder(design, law)
    response = beam.solve(design, Load(depth=1.0), "finite")
    answer = decode(made, np.array([hall.readings(design, response).B_T]))
    assert answer.force[0, 2] == pytest.approx(response.force[2], rel=0.02)
    cold = decode(decoder(paper(), of_level(paper(), "finite")), np.array([hall.readings(design, response).B_T]))
    assert abs(cold.force[0, 2] / response.force[2] - 1) > 0.15


def test_sweeps_share_solves_between_temperatures_and_moduli(tmp_path):
    cases = pd.DataFrame(
        {"E_MPa": [1.0, 2.0, 1.0, 2.0], "temperature_degC": [20.0, 20.0, WARM, WARM], "depth_mm": 0.1}
    )
    store = tmp_path / "states.db"
    found = magtip.answer(cases, ["fem:quick", "surrogate", "finite"], quantities=["force", "readings"], store=store)
    for model in ("fem", "surrogate", "analytic"):
        force = found[f"{model}_force_N"].to_numpy()
        assert force / force[0] == pytest.approx([1.0, 2.0, RUBBER, 2 * RUBBER], rel=1e-9)
    rest = found["fem_S1_V"].to_numpy() - 2.5
    assert rest / rest[0] == pytest.approx([1.0, 1.0, MAGNET * GAIN, MAGNET * GAIN], rel=1e-9)
    assert sqlite3.connect(store).execute("SELECT count(*) FROM state").fetchone() == (1,)


def test_labels_state_a_temperature_other_than_20_C():
    cold, warm = (design_digest.of_mechanics(design) for design in (paper(), warmed()))
    assert "temperature_degC" not in design_digest.label(cold)["made_for"]
    assert design_digest.label(warm)["made_for"]["temperature_degC"] == WARM
    with pytest.raises(magtip.BadInput, match="temperature 20 degC where this design has temperature 60 degC"):
        design_digest.check(design_digest.label(cold), warm, "a state")


def test_solved_states_are_of_the_modulus_at_the_temperature(run):
    rows = [
        json.loads(run("solve", "paper", "--depth", "1", "--accuracy", "quick", "--json", *words)[1])
        for words in ((), ("--set", "temperature=60"))
    ]
    for column in ("contact_pressure_MPa", "force_N"):
        cold, warm = (np.max(row[column]) for row in rows)
        assert warm / cold == pytest.approx(RUBBER, rel=1e-9)
    assert math.isclose(rows[1]["made_for"]["E_MPa"], 1.0)
