"""Lists and filters of stored states: which states they have, and that they stay fast."""

import contextlib
import sqlite3
import time
from dataclasses import replace

import pytest

from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_fields, store_listing
from studies.mechanics.store import State

ACCURACY = {
    "section_size": 0.16,
    "solid_size": 0.16,
    "section_patch": 0.012,
    "solid_patch": 0.03,
    "harmonics": 2,
    "friction_step_factor": 1.0,
}
CONTENT = {
    "shape": {"D": 1.0, "L": 1.125, "magnet_diameter": 0.5, "magnet_height": 0.25, "magnet_edge_radius": 0.0125},
    "nu": 0.4998,
    "law": ["neo-hookean"],
    "accuracy": ACCURACY,
    "magnet": "rigid",
    "model": "axisymmetric",
    "quantity": "states",
    "load": {"friction": "none", "grip": None, "plate_tilt": 0.0, "imperfection": 0.0},
    "physics": 2,
}
ANSWER = {
    "D_mm": 8.0,
    "E_MPa": 2.0,
    "response": {
        "force": [0.0, 0.0, 64.0],
        "shift": [0.0, 0.0, -2.0],
        "tilt": 0.0,
        "contact_radius": 1.0,
        "tilt_y": 0.0,
    },
    "error_estimate": 0.01,
    "message": "",
}
PRESSED = State(0.125, 0.0, "ok", "ok", ANSWER, 0.5, "on Python 3")
FAILED = replace(PRESSED, depth=0.25, outcome="failed", status="not_converged", answer=ANSWER | {"response": None})
DIED = replace(FAILED, depth=0.3, outcome="transient", status="worker_died")


@pytest.fixture
def file(tmp_path):
    """A store with a path of three states, and one of another law with a shear."""
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, FAILED, DIED])
        other = CONTENT | {"law": ["yeoh", 0.1, 0.0], "model": "harmonic", "accuracy": ACCURACY | {"harmonics": 7}}
        kept.add(
            other | {"physics": 3, "nu": 0.45, "load": {"friction": 0.3}}, [replace(PRESSED, shear=0.1, seconds=2.5)]
        )
    return file


def listing(file, *where, limit=0, of_paths=False, **filters):
    return store_listing.listing(Selection(store=file, where=list(where), **filters), limit, of_paths=of_paths)


def test_a_summary_counts_all_states(file):
    summary = listing(file).summary
    assert (summary.paths, summary.states, summary.states_in_store) == (2, 4, 4)
    assert (summary.ok, summary.failed, summary.transient) == (2, 1, 1)
    assert summary.solving_s == pytest.approx(4.0)
    assert summary.states_by_model == ("axisymmetric (physics 2): 3", "harmonic (physics 3): 1")
    assert summary.size_MB > 0


def test_a_row_is_dimensionless(file):
    (row,) = listing(file, "model=axisymmetric", "status=ok").rows
    assert (row["L_over_D"], row["depth_over_D"], row["accuracy"], row["friction"]) == (1.125, 0.125, "quick", "none")
    assert row["force_z_over_E_D2"] == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize(
    ("where", "count"),
    [
        ("law=yeoh", 1),
        ("law=neo-hookean,yeoh", 4),
        ("nu=0.45", 1),
        ("nu=0.45,0.4998", 4),
        ("nu=0.46:", 3),
        ("nu=:0.46", 1),
        ("nu=0.45:0.4998", 4),
        ("L_over_D=2:", 0),
        ("accuracy=quick", 3),
        ("accuracy=other", 1),
        ("friction=0.3", 1),
        ("magnet_diameter_over_D=0.5", 4),
        ("depth_over_D=0.2:0.3", 2),
        ("shear_over_D=0.1", 1),
        ("grip_over_D=0:", 0),
        ("status=worker_died", 1),
        ("force_z_over_E_D2=0.4:0.6", 2),
    ],
)
def test_a_filter_keeps_the_states_that_meet_it(file, where, count):
    shown = listing(file, where)
    assert (shown.summary.states, len(shown.rows)) == (count, count)


def test_filters_hold_together(file):
    assert listing(file, "law=neo-hookean", "depth_over_D=0.3", transient=True).summary.states == 1
    assert listing(file, "law=yeoh", transient=True).summary.states == 0


def test_failed_and_transient_states_are_shown_together(file):
    assert {row["status"] for row in listing(file, failed=True, transient=True).rows} == {
        "not_converged",
        "worker_died",
    }
    assert [row["status"] for row in listing(file, failed=True).rows] == ["not_converged"]


def test_dates_limit_the_states(file):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET added = '2026-03-01T12:00:00+00:00' WHERE shear > 0")
    assert listing(file, before="2026-03-02").summary.states == 1
    assert listing(file, since="2026-03-01T12:00").summary.states == 4
    assert listing(file, since="2026-03-01T13:00+01:00").summary.states == 4
    assert listing(file, since="2026-03-01T12:00:01").summary.states == 3
    assert [row["shear_over_D"] for row in listing(file).rows] == [0.0, 0.0, 0.0, 0.1]


def test_older_physics_is_that_below_the_version_of_today(file, monkeypatch):
    monkeypatch.setattr(
        "fem.physics_version.PHYSICS", {"axisymmetric": 2, "harmonic": 2, "states of another kind": 2}
    )
    assert listing(file, older_physics=True).summary.states == 0
    monkeypatch.setattr(
        "fem.physics_version.PHYSICS", {"axisymmetric": 3, "harmonic": 3, "states of another kind": 3}
    )
    assert listing(file, older_physics=True).summary.states_by_model == ("axisymmetric (physics 2): 3",)


def test_a_quantity_with_a_physics_version_of_its_own_is_compared_with_that(file, monkeypatch):
    with store.opened(file) as kept:
        kept.add(CONTENT | {"quantity": "modes", "physics": 3}, [PRESSED])
    monkeypatch.setattr("fem.physics_version.PHYSICS", {"axisymmetric": 1, "harmonic": 1, "modes": 4})
    assert listing(file, older_physics=True).summary.states_by_model == ("modes (physics 3): 1",)


def test_a_path_has_the_totals_of_its_states(file):
    (path,) = listing(file, "model=axisymmetric", of_paths=True).rows
    assert (path["states"], path["not_ok"], path["key"]) == (3, 2, store.key(CONTENT))
    assert (path["least_depth_over_D"], path["greatest_depth_over_D"]) == (0.125, 0.3)


def test_a_vibration_is_listed_at_the_load_about_which_it_is(file):
    load = {"depth": 0.125, "shear_x": 0.05, "friction": "stick"}
    with store.opened(file) as kept:
        kept.add(CONTENT | {"quantity": "response", "load": load}, [replace(PRESSED, depth=0.0)])
    (row,), (path,) = (listing(file, "quantity=response", of_paths=of_paths).rows for of_paths in (False, True))
    assert (row["depth_over_D"], row["shear_over_D"]) == (0.125, 0.05)
    assert (path["least_depth_over_D"], path["greatest_depth_over_D"], path["greatest_shear_over_D"]) == (
        *(0.125, 0.125, 0.05),
    )


def test_the_newest_rows_come_first(file):
    shown = listing(file, limit=2)
    assert (len(shown.rows), shown.summary.states) == (2, 4)
    assert shown.rows[0]["law"] == "yeoh"


def test_a_filter_that_no_state_meets_leaves_no_rows(file):
    assert listing(file, "friction=stick").rows == []


def test_every_value_of_a_filter_is_a_parameter(file):
    """No text of a filter becomes SQL."""
    assert listing(file, "status=ok') OR ('1'='1").rows == []


def test_a_state_that_was_changed_in_the_file_is_listed_without_its_answer(file):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET answer = replace(answer, '64.0', '99.0') WHERE shear > 0")
        other.execute("UPDATE state SET versions = CAST(x'ff' AS TEXT) WHERE depth = 0.25")
        other.execute("UPDATE state SET answer = 'text' WHERE depth = 0.3")
    found = listing(file)
    forces = [(row["status"], row["force_z_over_E_D2"]) for row in found.rows]
    assert sorted(forces, key=str) == [("damaged", None)] * 3 + [("ok", 0.5)]
    assert (found.damaged, found.summary.states) == (3, 4)
    assert listing(file, damaged=True).summary.states == 3


@pytest.mark.parametrize(
    ("where", "count"),
    [
        ("friction=0:1", 1),
        ("friction=0.3", 1),
        ("friction=0.30", 1),
        ("friction=0.4:", 0),
        ("friction=none", 3),
        ("friction=none,0.3", 4),
        ("friction=:0.3", 1),
    ],
)
def test_friction_is_a_word_or_a_number(file, where, count):
    assert listing(file, where).summary.states == count


def test_a_limit_may_be_larger_than_any_number_of_rows(file):
    assert len(listing(file, limit=10**24).rows) == len(listing(file, limit=10**24, of_paths=True).rows) * 2 == 4


def test_lists_read_no_answers_but_those_that_they_show(tmp_path):
    """100 000 states are listed in under a second only if contents and answers of most of them are not read."""
    file = tmp_path / "large.sqlite"
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": 0.4 + k * 1e-6}, [PRESSED]) for k in range(10_000))
    begin = time.process_time()
    assert listing(file, "nu=0.401:0.402", limit=20).summary.states == 1001
    assert listing(file, limit=20).summary.states == 10_000
    assert time.process_time() - begin < 0.5
    with contextlib.closing(sqlite3.connect(file)) as connection:
        states = store_listing.chosen(connection, store_fields.condition(Selection()))
        plan = connection.execute(f"EXPLAIN QUERY PLAN SELECT path, seconds FROM {states} JOIN listed ON id = path")
        assert "SCAN main.state USING COVERING INDEX state_listing" in [step[-1] for step in plan]
