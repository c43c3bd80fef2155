"""Published sensors: figures and their origins, files of requirements with the same boxes, the table."""

import json
import re

import pytest

from studies.sizing.catalogues import catalogues_of
from studies.sizing.published_sensors import REQUIRED, comparison, published_sensors, reached_in, remarks
from studies.sizing.requirements import read_requirements

SENSORS = {sensor["name"]: sensor for sensor in published_sensors()}


def figure(name, quantity):
    (one,) = [each for each in SENSORS[name]["figures"] if each["quantity"] == quantity]
    return one


@pytest.mark.parametrize(
    ("name", "quantity", "value"),
    [
        ("MagOne", "resolution_z", 1.42e-3),
        ("MagOne", "resolution_x", 0.71e-3),
        ("Dwivedi 2018", "resolution_z", 11.7e-3),
        ("Tomo 2016", "range_z", 14.2),
        ("eFlesh 2025", "resolution_z", 0.27),
        ("eFlesh 2025", "resolution_x", 0.12),
    ],
)
def test_figures_of_the_abstracts(name, quantity, value):
    one = figure(name, quantity)
    assert (one["value"], one["origin"]) == (pytest.approx(value), "abstract")


def test_the_range_that_an_error_in_percent_implies():
    assert figure("Dwivedi 2018", "range_z")["value"] == pytest.approx(11.7e-3 / 0.022, rel=1e-3)
    assert figure("Tomo 2016", "range_z")["value"] == pytest.approx(1.45 * 9.80665, rel=2e-3)


@pytest.mark.parametrize("name", SENSORS)
def test_requirements_have_the_same_box(name):
    sensor = SENSORS[name]
    requirements = read_requirements(str(sensor["requirements"]))
    for each in sensor["figures"]:
        if each["quantity"].startswith("resolution") and name != "Chathuranga 2016":
            continue  # a result of the sizing, not a bound
        assert getattr(requirements, REQUIRED.get(each["quantity"], each["quantity"])) == pytest.approx(each["value"])
    assert catalogues_of(requirements).magnets


def test_every_file_of_requirements_is_valid():
    folder = SENSORS["MagOne"]["requirements"].parent
    files = sorted(file for file in folder.glob("*.toml") if "force_z" in file.read_text("utf-8"))
    assert len(files) == 13
    for file in files:
        requirements = read_requirements(str(file))
        # two of them leave the bandwidth to the Hall parts
        assert not requirements.warnings() or file.stem in ("finger", "foot")
        assert catalogues_of(requirements).hall_parts


def test_what_is_not_comparable_is_stated():
    texts = remarks()
    assert len(texts) == len(SENSORS)
    assert all(re.search(r": [^:]*(noise|deviation)", text) for text in texts)


def test_a_variant_stands_beside_each_figure():
    rows = comparison({"MagOne": {"resolution_z": 2e-3}})
    assert sum(len(sensor["figures"]) for sensor in SENSORS.values()) == len(rows)
    values = {(row["sensor"], row["quantity"]): row["variant"] for row in rows}
    assert values["MagOne", "resolution_z"] == 2e-3
    assert values["MagOne", "range_z"] is None


def written(folder, front):
    (folder / "magone").mkdir(parents=True)
    (folder / "magone" / "sizing.json").write_text(json.dumps({"front": front}), "utf-8")
    return folder


ROW = {
    "status": "ok",
    "fem_range_z_N": 12.0,
    "fem_range_x_N": 2.0,
    "fem_resolution_z_mN": 3.0,
    "fem_resolution_x_mN": None,
    "outer_size_mm": 14.9,
    "height_mm": 13.0,
}


def test_results_are_read(tmp_path):
    reached = reached_in(written(tmp_path, [{"status": "failed"}, ROW]))["MagOne"]
    assert reached == {"range_z": 12.0, "range_x": 2.0, "resolution_z": 0.003, "outer_size": 14.9, "height": 13.0}


@pytest.mark.parametrize("front", [[], [{"status": "failed"}]])
def test_a_box_without_a_variant_is_left_out(tmp_path, refused, front):
    with refused("holds no result of magtip size in a folder named paper_sensor, magone"):
        reached_in(written(tmp_path, front))


def test_what_is_no_result_is_refused(tmp_path, refused):
    with refused("sizing.json is no result of magtip size", "run it again"):
        reached_in(written(tmp_path, [{"status": "ok"}]))
