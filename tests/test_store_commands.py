"""Stored states and what the verb store does with them: lists, filters, tables, removal with consent, and checks."""

import contextlib
import csv
import json
import sqlite3
from dataclasses import asdict, replace

import pytest

from fem.accuracy import LEVELS, QUICK
from fem.physics_version import ESTIMATES
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.inputs.option_groups import Selection
from studies.mechanics import path_solver, store, store_actions, store_check
from studies.mechanics.store import State
from studies.mechanics.store_actions import COLUMNS
from studies.mechanics.timed_quantities import STILL, PlateMotion
from studies.output import atomic_files

ACCURACY = {name: value for name, value in asdict(QUICK).items() if name != "name"}
SHAPE = {"D": 1.0, "L": 1.125, "magnet_diameter": 0.5, "magnet_height": 0.25, "magnet_edge_radius": 0.0125}
CONTENT = {
    "shape": SHAPE,
    "nu": 0.4998,
    "law": ["neo-hookean"],
    "accuracy": ACCURACY,
    "magnet": "rigid",
    "model": "axisymmetric",
    "quantity": "states",
    "load": {"friction": "none", "grip": None, "plate_tilt": 0.0, "imperfection": 0.0},
    "physics": 2,
    "estimates": ESTIMATES,
}
OTHER = CONTENT | {"law": ["yeoh", 0.1, 0.0], "model": "harmonic", "accuracy": ACCURACY | {"harmonics": 7}}
OTHER |= {"physics": 3, "nu": 0.45, "load": {"friction": 0.3}}
POSE = {"shift": [0.4, 0.0, -2.0], "tilt": 0.1, "contact_radius": 1.0, "tilt_y": 0.0}
ANSWER = {
    "D_mm": 8.0,
    "E_MPa": 2.0,
    "error_estimate": 0.01,
    "message": "",
    "response": POSE | {"force": [8, 0, 64.0]},
}
STOPPED = ANSWER | {"response": None, "message": "stops, early"}
PRESSED = State(0.125, 0.0, "ok", "ok", ANSWER, 0.5, "on Python 3")
FAILED = State(0.25, 0.0, "failed", "not_converged", STOPPED, 0.5, "")
DIED = replace(FAILED, depth=0.3, outcome="transient", status="worker_died")


@pytest.fixture
def file(tmp_path):
    """A store with a path of three states, and one of another law with a shear."""
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, FAILED, DIED])
        kept.add(OTHER, [replace(PRESSED, shear=1 / 3, seconds=2.5)])
    return file


def changed(file, *statements):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        for statement in statements:
            other.execute(statement)


def selected(file, *where, **filters):
    return Selection(store=file, where=list(where), **filters)


def listing(file, *where, of_paths=False, **filters):
    return store_actions.listing(selected(file, *where, **filters), 0, of_paths=of_paths)


# Lists


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
        ("law=neo-hookean,yeoh", 4),
        ("nu=0.45", 1),
        ("nu=0.46:", 3),
        ("nu=:0.46", 1),
        ("nu=0.45:0.4998", 4),
        ("L_over_D=2:", 0),
        ("accuracy=other", 1),
        ("friction=0.30", 1),
        ("friction=none,0.3", 4),
        ("friction=0.4:", 0),
        ("shear_over_D=0.333333333333", 1),
        ("grip_over_D=0:", 0),
        ("status=worker_died", 1),
        ("force_z_over_E_D2=0.4:0.6", 2),
        # no text of a filter becomes SQL
        ("status=ok') OR ('1'='1", 0),
    ],
)
def test_a_filter_keeps_the_states_that_meet_it(file, where, count):
    summary, rows = listing(file, where)
    assert (summary["states"], len(rows)) == (count, count)


def test_dates_and_physics_limit_the_states(file, monkeypatch):
    changed(file, "UPDATE state SET added = '2026-03-01T12:00:00+00:00' WHERE shear > 0")
    assert listing(file, before="2026-03-02")[0]["states"] == 1
    assert listing(file, since="2026-03-01T13:00+01:00")[0]["states"] == 4
    assert listing(file, since="2026-03-01T12:00:01")[0]["states"] == 3
    monkeypatch.setattr("fem.physics_version.PHYSICS", {"axisymmetric": 3, "harmonic": 3})
    assert listing(file, older_physics=True)[0]["states_by_model"] == ("axisymmetric (physics 2): 3",)
    monkeypatch.setattr("fem.physics_version.ESTIMATES", ESTIMATES + 1)
    assert listing(file, older_physics=True)[0]["states"] == 4


def test_a_path_has_the_totals_of_its_states_and_a_vibration_the_load_about_which_it_is(file):
    (path,) = listing(file, "model=axisymmetric", of_paths=True)[1]
    assert (path["states"], path["not_ok"], path["key"]) == (3, 2, store.key(CONTENT))
    assert (path["least_depth_over_D"], path["greatest_depth_over_D"]) == (0.125, 0.3)
    load = {"depth": 0.125, "shear_x": 0.05, "friction": "stick"}
    with store.opened(file) as kept:
        kept.add(CONTENT | {"quantity": "response", "load": load}, [replace(PRESSED, depth=0.0)])
    (row,), (path,) = (listing(file, "quantity=response", of_paths=of_paths)[1] for of_paths in (False, True))
    assert (row["depth_over_D"], row["shear_over_D"]) == (0.125, 0.05)
    assert listing(file, "quantity=response", "depth_over_D=0.125", "shear_over_D=0.05")[0]["states"] == 1
    assert (path["greatest_depth_over_D"], path["greatest_shear_over_D"]) == (0.125, 0.05)


def test_a_state_that_was_changed_in_the_file_is_listed_without_its_answer_and_not_exported(file, tmp_path, refused):
    changed(
        file,
        "UPDATE state SET answer = replace(answer, '64.0', '99.0') WHERE shear > 0",
        "UPDATE state SET versions = CAST(x'ff' AS TEXT) WHERE depth = 0.25",
        "UPDATE state SET answer = 'text' WHERE depth = 0.3",
    )
    forces = [(row["status"], row["force_z_over_E_D2"]) for row in listing(file)[1]]
    assert sorted(forces, key=str) == [("damaged", None)] * 3 + [("ok", 0.5)]
    assert listing(file, damaged=True)[0]["states"] == 3
    with refused("3 of 4 states", "are not as they were written"):
        exported(file, tmp_path / "states.csv")
    with refused("3 states are not as they were written, so whether they meet --where is not known"):
        listing(file, "force_z_over_E_D2=0.5")
    assert not (tmp_path / "states.csv").exists()
    assert len(exported(file, tmp_path / "states.csv", "status=ok", "nu=0.4998")) == 1


def test_lists_find_states_by_an_index_that_covers_what_they_need(file):
    """Answers are most of what a store holds: those of states that are not shown are not read."""
    with store_actions.reading(file) as connection:
        statements = []
        connection.set_trace_callback(statements.append)
        store_actions.choose(connection, selected(file, "nu=0.45", failed=True))
        plan = connection.execute(f"EXPLAIN QUERY PLAN {statements[0]}")
        assert "SCAN state USING COVERING INDEX state_listing" in [step[-1] for step in plan]


def test_values_of_the_accuracy_levels_have_their_names():
    for name, level in LEVELS.items():
        values = {key: value for key, value in asdict(level).items() if key != "name"}
        assert store_actions.accuracy_name(json.dumps(values)) == name


@pytest.mark.parametrize("kind", ["states", "modes", "critical depth", "response", "cycle"])
def test_every_value_of_a_content_has_a_column_of_its_own(kind, file):
    load = Load(depth=0.5, shear_x=0.1, friction="stick") if kind == "states" else Load(depth=0.5)
    place = path_solver.place(Scene(paper(), (load,), QUICK), kind, PlateMotion(frequency=1.0))
    with store.opened(file) as kept:
        kept.add(place.content, [PRESSED])
    with store_actions.reading(file) as connection:
        assert not {*store_actions.paths(connection)} - {*COLUMNS}
    assert len({*COLUMNS}) == len(COLUMNS)


def test_a_value_that_nobody_has_named_is_a_column_and_a_filter(file, tmp_path):
    pressure = {"values": {"contact_pressure_over_E": 0.7, "side": "left", "curve": [0.1] * 99}}
    with store.opened(file) as kept:
        kept.add(CONTENT | {"load": CONTENT["load"] | {"heat": 0.2}}, [replace(PRESSED, answer=ANSWER | pressure)])
    for where in ("contact_pressure_over_E=0.6:0.8", "side=left,right", "load_heat=0.2"):
        assert listing(file, where)[0]["states"] == 1
    for suffix in ("csv", "parquet", "jsonl"):
        rows = exported(file, tmp_path / f"states.{suffix}")
        assert [list(row)[len(COLUMNS) :] for row in rows] == [["load_heat", "contact_pressure_over_E", "side"]] * 5
        assert [row["side"] for row in rows] == [None, None, None, None, "left"]
        assert float(rows[-1]["contact_pressure_over_E"]) == 0.7


# Tables of all columns


def exported(file, out, *where):
    store_actions.export(selected(file, *where), out, lambda fraction, text: None)
    if out.suffix == ".jsonl":
        return [json.loads(line) for line in out.read_text("utf-8").splitlines()]
    if out.suffix == ".csv":
        with out.open(newline="", encoding="utf-8") as stream:
            return [{name: value or None for name, value in row.items()} for row in csv.DictReader(stream)]
    from pyarrow import parquet

    return parquet.read_table(out).to_pylist()


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_has_all_columns_over_D_and_E(file, tmp_path, suffix):
    rows = exported(file, tmp_path / "out" / f"states.{suffix}")
    assert [list(row) for row in rows] == [list(COLUMNS)] * 4
    pressed, failed, _, rubbed = rows
    values = {name: float(pressed[name]) for name in ("force_x_over_E_D2", "force_z_over_E_D2", "shift_z_over_D")}
    assert values == pytest.approx({"force_x_over_E_D2": 1 / 16, "force_z_over_E_D2": 0.5, "shift_z_over_D": -0.25})
    assert (failed["force_z_over_E_D2"], failed["message"], failed["outcome"]) == (None, "stops, early", "failed")
    assert (rubbed["law"], float(rubbed["law_number_1"]), str(rubbed["friction"])) == ("yeoh", 0.1, "0.3")
    assert float(rubbed["shear_over_D"]) == pytest.approx(1 / 3, rel=1e-11)


def test_an_export_without_states_writes_nothing(file, tmp_path, refused):
    atomic_files.write_text(tmp_path / "states.csv", "old")
    with refused("no state of the store", "meets the filters, so states.csv is not written"):
        exported(file, tmp_path / "states.csv", "nu=0.1")
    assert (tmp_path / "states.csv").read_text() == "old"


# Removal


def test_states_are_removed_with_their_paths_and_their_space_is_given_back_while_another_process_reads(file):
    long = replace(PRESSED, answer=ANSWER | {"message": "x" * 500})
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": 0.3, "k": k}, [long]) for k in range(300))
    size = file.stat().st_size
    with store.readable(file) as reader:
        reader.execute("BEGIN")
        assert reader.execute("SELECT COUNT(*) FROM state").fetchone() == (304,)
        assert store_actions.prune(selected(file, "nu=0.45"), yes=True)["states"] == 1
        assert reader.execute("SELECT COUNT(*) FROM state").fetchone() == (304,)
    pruning = store_actions.prune(selected(file, "nu=0.3"), yes=True)
    assert [pruning[name] for name in ("removed", "states", "paths", "states_left")] == [True, 300, 300, 3]
    assert file.stat().st_size < size / 2
    assert pruning["freed_MB"] > pruning["size_MB"] / 2
    with store.opened(file) as kept:
        assert (kept.counts(), set(kept.states(CONTENT))) == ((1, 3), {(0.125, 0.0), (0.25, 0.0), (0.3, 0.0)})


def test_damaged_states_are_removed(file):
    changed(
        file, "UPDATE state SET answer = '{' WHERE outcome = 'failed'", "UPDATE path SET content = '{' WHERE id = 2"
    )
    for yes in (False, True):
        assert store_actions.prune(selected(file, damaged=True), yes=yes)["states"] == 2
    assert store_actions.prune(selected(file, damaged=True), yes=False)["states"] == 0


# Checks: each finds its own damage, and only that; a state solved again comes out as it is stored.

NAMES = list(store_check.CHECKS)


def failures(file):
    return {check["check"]: check["message"] for check in store_check.checks(file) if check["status"] != "ok"}


def test_a_store_in_order_passes_all_checks_and_is_not_changed(file):
    before = file.read_bytes()
    results = list(store_check.checks(file))
    assert [(result["check"], result["status"]) for result in results] == [(name, "ok") for name in NAMES]
    assert [result["checked"] for result in results][1:] == [4, 2, 4, 2]
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("statement", "number", "message"),
    [
        ("UPDATE path SET content = replace(content, '0.4998', '0.46')", 2, "path 1 is damaged: magtip store prune"),
        ("UPDATE path SET content = '{\"nu\": NaN}' WHERE id = 2", 2, "path 2 is damaged"),
        ("UPDATE state SET answer = replace(answer, '64', '99') WHERE path = 2", 3, "a state of path 2 is damaged"),
        ("UPDATE state SET answer = '{\"res'", 3, "and 1 more: magtip store prune --damaged --yes"),
        ("UPDATE state SET depth = 0.1250000000000007 WHERE path = 2", 3, "a state of path 2 is damaged"),
        ("DELETE FROM path WHERE id = 2", 1, "a state has no path"),
    ],
)
def test_damage_is_found(file, statement, number, message):
    changed(file, statement)
    found = failures(file)
    assert message in found.pop(NAMES[number])
    assert not found


def page_of(file, name):
    """The offset and the length of the first page of a table or an index."""
    with contextlib.closing(sqlite3.connect(file)) as other:
        other.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        (page,) = other.execute(f"SELECT rootpage FROM sqlite_master WHERE name = '{name}'").fetchone()
        (size,) = other.execute("PRAGMA page_size").fetchone()
    return (page - 1) * size, size


def overwritten(file, name, page):
    start, size = page_of(file, name)
    content = bytearray(file.read_bytes())
    content[start : start + size] = page(size)
    file.write_bytes(content)


def test_an_index_that_lacks_a_row_is_found(file):
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": k / 1000}, [PRESSED]) for k in range(400))
    # an index without any rows: a valid page, of the kind of a leaf of an index
    leaf = bytes([10, 0, 0, 0, 0])
    overwritten(file, "state_listing", lambda size: leaf + size.to_bytes(2, "big") + bytes(size - 7))
    assert "state_listing" in failures(file)[NAMES[0]]


def test_a_table_that_cannot_be_read_fails_its_checks_only(file):
    overwritten(file, "state", bytes)
    messages = failures(file)
    assert set(messages) == {NAMES[0], NAMES[1], NAMES[3]}
    assert "the file cannot be read there (database disk image is malformed)" in messages[NAMES[3]]


ROUGH = replace(QUICK, name="rough", section_size=0.25, section_patch=0.03, harmonics=1)
SHORT = replace(paper(), D=6.0, l0=paper().l0 + 1.0)
PRONY = replace(paper(), prony="0.2:0.01 0.1:0.001", modulus="instantaneous")
CASES = {
    "press": (SHORT, Load(depth=0.5), "rigid", "states"),
    "silicone": (replace(paper(), law="yeoh", yeoh_2=0.1, E=2.0), Load(depth=0.4), "ignored", "states"),
    "stick": (paper(), Load(depth=0.5, shear_x=0.3, shear_y=0.1, friction="stick"), "rigid", "states"),
    "grip": (paper(), Load(shear_x=0.3, grip=2.0), "rigid", "states"),
    "friction": (paper(), Load(depth=0.3, shear_x=0.2, friction=0.3), "rigid", "states"),
    "imperfection": (replace(paper(), E=3.0), Load(depth=0.3, imperfection=0.001), "rigid", "states"),
    "ogden": (replace(paper(), law="ogden"), Load(depth=0.5), "rigid", "states"),
    "modes": (replace(paper(), magnet_density=7000.0), Load(depth=0.5), "rigid", "modes"),
    "response": (replace(paper(), density=1200.0, E=2.0), Load(0.5, 0.2, friction="stick"), "rigid", "response"),
    "response at rest": (PRONY, Load(0.5), "rigid", "response"),
    "elastic response": (replace(paper(), loss_factor=0.0), Load(depth=0.5), "ignored", "response"),
    "cycle": (replace(paper(), loss_factor=0.2), Load(0.5, 0.2, friction=0.3), "rigid", "cycle"),
    "elastic cycle": (replace(paper(), loss_factor=0.0), Load(depth=0.5), "ignored", "cycle"),
    "critical depth": (replace(paper(), L=20.0), Load(depth=0.5), "ignored", "critical depth"),
}


def place_of(name):
    design, load, magnet, kind = CASES[name]
    motion = PlateMotion(speed=0.7) if "cycle" in name else STILL
    return path_solver.place(Scene(design, (load,), ROUGH, magnet), kind, motion)


@pytest.mark.parametrize("name", CASES)
def test_a_problem_is_rebuilt_from_what_is_stored(name):
    """The rebuilt problem has the same key, so it is the same problem."""
    place = place_of(name)
    content = json.loads(json.dumps(place.content))
    stored = path_solver.problem_of(place.scene.design, place.scene.loads[0], place.motion)
    again = store_check.problem(content, State(*place.at, "ok", "ok", json.loads(json.dumps(stored)), 0.0, ""))
    assert (store.key(again.content), again.at) == (store.key(place.content), place.at)


@pytest.fixture(scope="module")
def solved():
    """A press and a grip as they are solved."""
    tasks = {name: path_solver.task(1, place_of(name), [place_of(name).at]) for name in ("press", "grip")}
    return {name: path_solver.solve_task(task) for name, task in tasks.items()}


@pytest.fixture
def resolved(tmp_path, solved):
    """A store of the solved states with others in their places, and what is said of those that are solved again."""
    file = tmp_path / "solved.sqlite"

    def differences(others=(), count=5, seed=0):
        with store.opened(file) as kept:
            for name, states in solved.items():
                kept.add(place_of(name).content, states)
            for content, states in others:
                kept.add(content, states)
        with store_actions.reading(file) as connection:
            rows = store_check.chosen(connection, count, seed)
            return rows, list(store_check.differences(connection, rows, None)) if count > 2 else []

    return differences


def test_states_come_out_as_they_are_stored_those_of_other_physics_and_failed_ones_are_left_out(resolved, solved):
    failed = [replace(state, depth=0.7, outcome="failed") for state in solved["grip"]]
    rows, found = resolved(
        [(place_of("press").content | {"physics": 0}, solved["press"]), (place_of("grip").content, failed)]
    )
    assert (sorted(path for path, _, _ in rows), found) == ([1, 2], [])


@pytest.mark.parametrize(("error_estimate", "count"), [(0.01, 1), (0.1, 0)])
def test_a_state_that_differs_by_more_than_its_estimate_is_found(resolved, solved, error_estimate, count):
    (state,) = solved["press"]
    force = [1.05 * part for part in state.answer["response"]["force"]]
    answer = {"response": state.answer["response"] | {"force": force}, "error_estimate": error_estimate}
    _, found = resolved([(place_of("press").content, [replace(state, answer=state.answer | answer)])])
    said = "path 1 at depth 0.0833333 D and shear 0 D differs by 4.8 % (estimated error"
    assert [said in text for text in found] == [True] * count


def test_the_seed_chooses_the_states_and_a_content_of_another_program_is_named(resolved, solved):
    new = place_of("press").content | {"new": 1}
    assert resolved([(new, solved["press"])])[1][-1].endswith("has a content that this version does not know")
    more = [
        (place_of("press").content | {"k": k}, [State(0.1, 0.0, "ok", "ok", {"solved": {}}, 0.0, "")])
        for k in range(50)
    ]
    first, again, other = (resolved(more, 2, seed)[0] for seed in (1, 1, 2))
    assert (first, len(first)) == (again, 2)
    assert first != other


# The verb


def test_a_list_begins_with_its_summary_and_the_user_s_store_needs_no_option(run, file, strict):
    status, out, err = run("store", "list", "--store", file, "--json")
    summary, *rows = strict(out)
    assert (status, err, summary["states"], len(rows)) == (0, "", 4, 4)
    status, _, err = run("store", "list", "--store", file, "--where", "nu=0.1")
    assert (status, err) == (0, "magtip: no state of the store meets the filters\n")
    with store.opened(store.default()) as kept:
        kept.add(CONTENT, [PRESSED])
    assert strict(run("store", "list", "--json")[1])[0]["states"] == 1


def test_a_force_that_was_changed_in_the_file_is_no_answer(run, tmp_path, strict):
    file = tmp_path / "s.sqlite"
    sweep = ("sweep", "paper", "--axis", "depth=0.5", "--accuracy", "quick", "--magnet", "ignored", "--store", file)
    (first,) = strict(run(*sweep, "--json")[1])
    assert run("store", "check", "--store", file)[0] == 0
    changed(file, "UPDATE state SET answer = json_set(answer, '$.response.force[2]', 99.0)")
    status, out, _ = run("store", "check", "--store", file, "--json")
    assert (status, [row["check"] for row in strict(out) if row["status"] != "ok"]) == (3, [NAMES[3]])
    assert "1 of the listed states are not as they were written" in run("store", "list", "--store", file)[2]
    status, out, err = run(*sweep, "--json")
    (again,) = strict(out)
    assert (status, again["fem_force_N"]) == (0, first["fem_force_N"])
    assert "its digest does not match what it holds: it is solved again" in err
    assert run("store", "check", "--store", file)[0] == 0


def test_a_missing_store_is_refused(refusal, tmp_path):
    for action in (["list"], ["check"], ["export", "--out", "x.csv"], ["prune", "--failed"]):
        assert "there is no store" in refusal("store", *action, "--store", tmp_path / "none.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_an_export_is_counted_and_never_replaces_the_store(run, refusal, file, tmp_path, strict):
    status, out, _ = run("store", "export", "--store", file, "--out", "states.csv", "--failed", "--json")
    assert (status, strict(out)) == (0, [{"file": "states.csv", "states": 1}])
    assert len((tmp_path / "states.csv").read_text().splitlines()) == 2
    target = file.rename(file.with_suffix(".csv"))
    before = target.read_bytes()
    assert "is also the input" in refusal("store", "export", "--store", target, "--out", target)
    assert target.read_bytes() == before


def test_a_check_ends_with_status_3_and_the_remedy_or_with_what_is_checked_before_an_interrupt(
    run, file, strict, monkeypatch
):
    with store.opened(file) as kept:
        kept.add(CONTENT | {"physics": 99}, [PRESSED])
    status, out, err = run("store", "check", "--store", file)
    assert (status, "physics versions" in out, "update magtip" in err) == (3, True, True)
    real = store_check.checks

    def stops(*args):
        yield next(real(*args))
        raise KeyboardInterrupt

    monkeypatch.setattr(store_check, "checks", stops)
    status, out, err = run("store", "check", "--store", file, "--json")
    assert (status, [row["status"] for row in strict(out)]) == (130, ["ok"])
    assert "1 rows are complete" in err


def test_prune_removes_with_consent_only(run, file, strict):
    prune = ("store", "prune", "--store", file, "--failed", "--json")
    status, out, err = run(*prune)
    assert (status, strict(out)[0]["removed"], strict(out)[0]["states"]) == (0, False, 1)
    assert "add --yes" in err
    assert strict(run(*prune, "--yes")[1])[0]["removed"] is True
    assert strict(run("store", "list", "--store", file, "--json")[1])[0]["states"] == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("list x", "store list takes options only: leave out 'x'"),
        ("list --limit -1", "--limit must be at least 0"),
        ("list --limit 2.5", "--limit must be a whole number"),
        ("list --were nu=1", "there is no option --were: did you mean --where?"),
        ("list --where nu", "must be NAME=VALUE, NAME=a,b or NAME=low:high, such as nu=0.45:0.5; got 'nu'"),
        ("list --where =3", "must be NAME=VALUE"),
        ("list --where nuu=3", "there is no field 'nuu': did you mean nu?"),
        ("list --where nu=1:nan", "nu must be a number"),
        ("list --where nu=0.5:0.4", "the range of nu is empty"),
        ("list --since yesterday", "--since must be a date or time"),
        ("prune --yes", "prune needs a filter, such as --failed"),
        ("export", "--out"),
        ("export --out states.xlsx", "must end in .csv or .parquet or .jsonl"),
    ],
)
def test_bad_input_has_one_sentence(refusal, words, message):
    with store.opened(store.default()):
        pass
    assert message in refusal("store", *words.split())
