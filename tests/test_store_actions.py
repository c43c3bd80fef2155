"""What is done with stored states: lists and filters, tables of all columns, and removal with consent only."""

import contextlib
import csv
import json
import re
import sqlite3
import time
from dataclasses import asdict, replace

import pytest

from fem.accuracy import LEVELS, QUICK
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.inputs.option_groups import Selection
from studies.mechanics import path_solver, store, store_actions
from studies.mechanics.store import State
from studies.mechanics.store_actions import FIELDS
from studies.mechanics.timed_quantities import PlateMotion
from studies.output import atomic_files

# Lists

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
    return store_actions.listing(Selection(store=file, where=list(where), **filters), limit, of_paths=of_paths)


def test_a_summary_counts_all_states(file):
    summary, _ = listing(file)
    assert [summary[name] for name in ("paths", "states", "states_in_store")] == [2, 4, 4]
    assert [summary[name] for name in ("ok", "failed", "transient")] == [2, 1, 1]
    assert summary["solving_s"] == pytest.approx(4.0)
    assert summary["states_by_model"] == ("axisymmetric (physics 2): 3", "harmonic (physics 3): 1")
    assert summary["size_MB"] > 0


def test_a_row_is_dimensionless(file):
    (row,) = listing(file, "model=axisymmetric", "status=ok")[1]
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
        ("friction=0.30", 1),
        ("friction=none,0.3", 4),
        ("friction=0.4:", 0),
        ("friction=:0.3", 1),
        ("magnet_diameter_over_D=0.5", 4),
        ("depth_over_D=0.2:0.3", 2),
        ("shear_over_D=0.1", 1),
        ("grip_over_D=0:", 0),
        ("status=worker_died", 1),
        ("force_z_over_E_D2=0.4:0.6", 2),
    ],
)
def test_a_filter_keeps_the_states_that_meet_it(file, where, count):
    summary, rows = listing(file, where)
    assert (summary["states"], len(rows)) == (count, count)


def test_dates_limit_the_states(file):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET added = '2026-03-01T12:00:00+00:00' WHERE shear > 0")
    assert listing(file, before="2026-03-02")[0]["states"] == 1
    assert listing(file, since="2026-03-01T12:00")[0]["states"] == 4
    assert listing(file, since="2026-03-01T13:00+01:00")[0]["states"] == 4
    assert listing(file, since="2026-03-01T12:00:01")[0]["states"] == 3
    assert [row["shear_over_D"] for row in listing(file)[1]] == [0.0, 0.0, 0.0, 0.1]


def test_older_physics_is_that_below_the_version_of_today(file, monkeypatch):
    monkeypatch.setattr(
        "fem.physics_version.PHYSICS", {"axisymmetric": 2, "harmonic": 2, "states of another kind": 2}
    )
    assert listing(file, older_physics=True)[0]["states"] == 0
    monkeypatch.setattr(
        "fem.physics_version.PHYSICS", {"axisymmetric": 3, "harmonic": 3, "states of another kind": 3}
    )
    assert listing(file, older_physics=True)[0]["states_by_model"] == ("axisymmetric (physics 2): 3",)


def test_a_path_has_the_totals_of_its_states(file):
    (path,) = listing(file, "model=axisymmetric", of_paths=True)[1]
    assert (path["states"], path["not_ok"], path["key"]) == (3, 2, store.key(CONTENT))
    assert (path["least_depth_over_D"], path["greatest_depth_over_D"]) == (0.125, 0.3)


def test_a_vibration_is_listed_at_the_load_about_which_it_is(file):
    load = {"depth": 0.125, "shear_x": 0.05, "friction": "stick"}
    with store.opened(file) as kept:
        kept.add(CONTENT | {"quantity": "response", "load": load}, [replace(PRESSED, depth=0.0)])
    (row,), (path,) = (listing(file, "quantity=response", of_paths=of_paths)[1] for of_paths in (False, True))
    assert (row["depth_over_D"], row["shear_over_D"]) == (0.125, 0.05)
    assert (path["least_depth_over_D"], path["greatest_depth_over_D"], path["greatest_shear_over_D"]) == (
        *(0.125, 0.125, 0.05),
    )


def test_every_value_of_a_filter_is_a_parameter(file):
    """No text of a filter becomes SQL."""
    assert listing(file, "status=ok') OR ('1'='1")[1] == []


def test_a_state_that_was_changed_in_the_file_is_listed_without_its_answer(file):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET answer = replace(answer, '64.0', '99.0') WHERE shear > 0")
        other.execute("UPDATE state SET versions = CAST(x'ff' AS TEXT) WHERE depth = 0.25")
        other.execute("UPDATE state SET answer = 'text' WHERE depth = 0.3")
    summary, rows = listing(file)
    forces = [(row["status"], row["force_z_over_E_D2"]) for row in rows]
    assert sorted(forces, key=str) == [("damaged", None)] * 3 + [("ok", 0.5)]
    assert summary["states"] == 4
    assert listing(file, damaged=True)[0]["states"] == 3


def test_lists_read_no_answers_but_those_that_they_show(tmp_path):
    """100 000 states are listed in under a second only if answers of most of them are not read."""
    file = tmp_path / "large.sqlite"
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": 0.4 + k * 1e-6}, [PRESSED]) for k in range(4000))
    begin = time.process_time()
    assert listing(file, "nu=0.401:0.402", limit=20)[0]["states"] == 1001
    assert listing(file, limit=20)[0]["states"] == 4000
    assert time.process_time() - begin < 0.3
    with contextlib.closing(sqlite3.connect(file)) as connection:
        states = store_actions.chosen(connection, store_actions.condition(Selection()))
        plan = connection.execute(f"EXPLAIN QUERY PLAN SELECT path, SUM(seconds) FROM {states} GROUP BY path")
        assert "SCAN main.state USING COVERING INDEX state_listing" in [step[-1] for step in plan]


@pytest.mark.parametrize(
    ("where", "parts"),
    [
        ("nu", ["must be NAME=VALUE", "got 'nu'"]),
        ("=3", ["must be NAME=VALUE"]),
        ("nuu=3", ["there is no field 'nuu': did you mean nu?"]),
        ("nu=abc", ["nu must be a number", "got 'abc'"]),
        ("nu=1:nan", ["nu must be a number", "got 'nan'"]),
        ("nu=0.5:0.4", ["the range of nu is empty", "0.5:0.4"]),
    ],
)
def test_a_wrong_filter_is_refused(where, parts, refused):
    with refused(*parts):
        store_actions.condition(Selection(where=[where]))


def test_a_wrong_date_is_refused(refused):
    with refused("--since must be a date or time", "got 'yesterday'"):
        store_actions.condition(Selection(since="yesterday"))


def test_values_of_the_accuracy_levels_have_their_names():
    for name, level in LEVELS.items():
        values = {key: value for key, value in asdict(level).items() if key != "name"}
        assert store_actions.accuracy_name(json.dumps(values)) == name


def places(content, at=""):
    """The places of all values of a content, as SQLite names them; an accuracy is one."""
    for name, value in content.items():
        if isinstance(value, dict) and name != "accuracy":
            yield from places(value, f"{at}{name}.")
        elif isinstance(value, list):
            yield from (f"{at}{name}[{k}]" for k in range(len(value)))
        elif value is not None:
            yield f"{at}{name}"


@pytest.mark.parametrize(
    ("load", "kind"),
    [
        (Load(depth=0.5), "states"),
        (Load(depth=0.5, shear_x=0.1, friction="stick"), "states"),
        (Load(depth=0.5), "modes"),
        (Load(depth=0.5), "critical depth"),
        (Load(depth=0.5), "response"),
        (Load(depth=0.5), "cycle"),
    ],
)
def test_every_value_of_a_content_is_a_field(load, kind):
    content = path_solver.place(Scene(paper(), (load,), QUICK), kind, PlateMotion(frequency=1.0)).content
    of_fields = {place for field in FIELDS.values() for place in re.findall(r"\$\.([^']+)", field.sql)}
    # D is 1 over D, and the number of modes is the same in all contents
    assert set(places(content)) - {"shape.D", "load.count"} <= of_fields


def test_physics_versions_are_those_of_the_program():
    condition = store_actions.current_physics("=")
    assert all(f"= '{name}' THEN {version}" in condition for name, version in PHYSICS.items())


# Export

OTHER_CONTENT = {name: value for name, value in CONTENT.items() if name not in ("load", "accuracy", "quantity")}
OTHER_CONTENT |= {"law": ["yeoh", 0.1, 0.0], "model": "harmonic", "physics": 1}
SHEARED = {"force": [8.0, 0.0, 64.0], "shift": [0.4, 0.0, -2.0], "tilt": 0.1}
OTHER_ANSWER = ANSWER | {"response": ANSWER["response"] | SHEARED}
OTHER_PRESSED = State(0.125, 1 / 3, "ok", "ok", OTHER_ANSWER, 0.5, "on Python 3")
STOPPED = OTHER_ANSWER | {"response": None, "message": "stops, early"}
OTHER_FAILED = State(0.25, 0.0, "failed", "not_converged", STOPPED, 0.1, "")


@pytest.fixture
def three(tmp_path):
    three = tmp_path / "solved.sqlite"
    with store.opened(three) as kept:
        kept.add(OTHER_CONTENT, [OTHER_PRESSED, OTHER_FAILED])
        kept.add(OTHER_CONTENT | {"nu": 0.45, "load": {"friction": 0.3}}, [OTHER_PRESSED])
    return three


def exported(three, out, *where):
    count = store_actions.export(Selection(store=three, where=list(where)), out, lambda fraction, text: None)
    if out.suffix == ".jsonl":
        rows = [json.loads(line) for line in out.read_text("utf-8").splitlines()]
    elif out.suffix == ".csv":
        with out.open(newline="", encoding="utf-8") as stream:
            rows = [{name: value or None for name, value in row.items()} for row in csv.DictReader(stream)]
    else:
        from pyarrow import parquet

        rows = parquet.read_table(out).to_pylist()
    assert count == len(rows)
    return rows


def test_states_that_were_changed_in_the_file_are_not_exported(three, tmp_path, refused):
    with contextlib.closing(sqlite3.connect(three)) as other, other:
        other.execute("UPDATE state SET answer = replace(answer, '64.0', '99.0') WHERE path = 2")
    with refused("1 of 3 states", "are not as they were written"):
        exported(three, tmp_path / "states.csv")
    assert not (tmp_path / "states.csv").exists()
    assert len(exported(three, tmp_path / "states.csv", "nu=0.4998")) == 2


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_has_all_columns_over_D_and_E(three, tmp_path, suffix):
    rows = exported(three, tmp_path / "out" / f"states.{suffix}")
    assert [list(row) for row in rows] == [list(FIELDS)] * 3
    pressed, failed, rubbed = rows
    values = {name: float(pressed[name]) for name in ("force_x_over_E_D2", "force_z_over_E_D2", "shift_z_over_D")}
    assert values == pytest.approx({"force_x_over_E_D2": 1 / 16, "force_z_over_E_D2": 0.5, "shift_z_over_D": -0.25})
    assert float(pressed["shear_over_D"]) == pytest.approx(1 / 3, rel=1e-11)
    assert (pressed["law"], float(pressed["law_number_1"]), pressed["friction"]) == ("yeoh", 0.1, None)
    assert (failed["force_z_over_E_D2"], failed["message"], failed["outcome"]) == (None, "stops, early", "failed")
    assert (str(rubbed["friction"]), float(rubbed["nu"])) == ("0.3", 0.45)


def test_an_export_without_states_writes_nothing(three, tmp_path, refused):
    out = tmp_path / "states.csv"
    atomic_files.write_text(out, "old")
    with refused("no state of the store", "meets the filters, so states.csv is not written"):
        exported(three, out, "nu=0.1")
    assert out.read_text() == "old"


def test_an_export_has_a_suffix(three, tmp_path, refused):
    with refused("must end in .csv or .parquet or .jsonl"):
        exported(three, tmp_path / "states.xlsx")


def test_an_export_that_breaks_off_leaves_the_old_file(three, tmp_path):
    out = tmp_path / "states.csv"
    atomic_files.write_text(out, "old")

    def stop(fraction, text):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store_actions.export(Selection(store=three), out, stop)
    assert out.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir() if "writing" in path.name) == []


# Removal

SMALL = {"model": "harmonic", "physics": 1, "nu": 0.45}
SMALL_PRESSED = State(0.125, 0.0, "ok", "ok", {"response": {"force": [0.0, 0.0, 1.0]}, "message": "x" * 500}, 0.5, "")
SMALL_FAILED = State(0.25, 0.0, "failed", "not_converged", {"response": None}, 0.5, "")


@pytest.fixture
def many(tmp_path):
    many = tmp_path / "solved.sqlite"
    with store.opened(many) as kept:
        kept.add(SMALL, [SMALL_PRESSED, SMALL_FAILED])
        kept.add_many((SMALL | {"nu": 0.3, "k": k}, [SMALL_PRESSED]) for k in range(300))
        kept.add(SMALL | {"nu": 0.2}, [SMALL_FAILED])
    return many


def prune(many, *where, yes=False, **filters):
    return store_actions.prune(Selection(store=many, where=list(where), **filters), yes=yes)


def counts(many):
    with store.opened(many) as kept:
        return kept.counts()


def test_states_are_removed_and_their_space_is_given_back(many):
    size = many.stat().st_size
    pruning = prune(many, "nu=0.3", yes=True)
    assert (pruning["removed"], pruning["states"], pruning["paths"], pruning["states_left"]) == (True, 300, 300, 3)
    assert counts(many) == (2, 3)
    assert many.stat().st_size < size / 2
    assert pruning["freed_MB"] > pruning["size_MB"] / 2
    with store.opened(many) as kept:
        assert set(kept.states(SMALL)) == {(0.125, 0.0), (0.25, 0.0)}


def test_a_path_goes_with_its_last_state(many):
    pruning = prune(many, failed=True, yes=True)
    assert (pruning["states"], pruning["paths"]) == (2, 1)
    assert counts(many) == (301, 301)


def test_damaged_states_are_removed(many):
    with contextlib.closing(sqlite3.connect(many)) as other, other:
        other.execute("UPDATE state SET answer = '{' WHERE outcome = 'failed' AND path = 1")
        other.execute("UPDATE path SET content = '{' WHERE id = 2")
    assert (prune(many, damaged=True)["states"], prune(many, damaged=True, yes=True)["states"]) == (2, 2)
    assert counts(many) == (301, 301)
    assert prune(many, damaged=True)["states"] == 0


def test_all_states_go_only_by_a_filter(many, refused):
    with refused("prune needs a filter, such as --failed"):
        prune(many, yes=True)
    assert counts(many) == (302, 303)


def test_a_process_that_reads_meanwhile_is_not_disturbed(many):
    with store.readable(many) as reader:
        rows = reader.execute("SELECT COUNT(*) FROM state")
        reader.execute("BEGIN")
        assert rows.fetchone() == (303,)
        reader.execute("SELECT COUNT(*) FROM state").fetchone()
        assert prune(many, failed=True, yes=True)["states"] == 2
        assert reader.execute("SELECT COUNT(*) FROM state").fetchone() == (303,)
    assert counts(many) == (301, 301)
