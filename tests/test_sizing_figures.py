import pytest

from studies.report import folder_contents, sizing_figures

HEAD = (
    "rank,point,status,D_mm,L_mm,magnet,silicone,hall_part,outer_size_mm,fem_range_z_N,fem_resolution_z_mN,"
    "range_z_difference_percent"
)
ROWS = (
    "1,1,ok,8,9,disc 4 x 2,Dragon Skin 30,SS495A,12,6,4,1.5",
    "2,2,ok,9,9,disc 5 x 2,,SS495A,14,8,9,-2",
    ",3,failed,6,9,,,,9,3,2,-6",
)


@pytest.fixture
def front(tmp_path):
    (tmp_path / "front.csv").write_text("\n".join([HEAD, *ROWS]))
    return folder_contents.csv_table(tmp_path / "front.csv")


def test_front_tells_the_best_from_the_removed(front):
    resolution, size, differences = sizing_figures.front(front)
    assert [(one.name, one.x, one.y) for one in resolution.panels[0].series] == [
        ("best variant", (6,), (4,)),
        ("meets all requirements", (8,), (9,)),
        ("removed by finite elements", (3,), (2,)),
    ]
    assert resolution.caption.startswith("2 of 3 variants")
    assert "D 8 mm, L 9 mm, disc 4 x 2" in resolution.caption
    assert size.y.label == "outer size (mm)"
    assert "range z, -6 %" in differences.caption


def test_points_are_named_by_their_rank(front):
    best, passed, failed = sizing_figures.front(front)[0].panels[0].series
    assert (best.labels, passed.labels, failed.labels) == (("1",), ("2",), ("",))


def test_front_is_a_table_of_its_main_columns(front):
    table = sizing_figures.front_sheet(front)
    assert list(table.columns)[:4] == ["rank", "status", "D_mm", "L_mm"]
    assert "range_z_N" in table.columns
    assert len(table) == 3


def test_differences_have_a_point_for_each_variant(front):
    differences = sizing_figures.front(front)[-1]
    assert sum(len(one.x) for one in differences.panels[0].series) == 3


def test_yield_has_its_interval(tmp_path):
    (tmp_path / "yield.csv").write_text(
        "requirement,sensors,within,within_percent,low_percent,high_percent\nall,1000,912,91.2,89,93\n"
        "largest_strain,1000,950,95,93,96\n"
    )
    (figure,) = sizing_figures.made_within(folder_contents.csv_table(tmp_path / "yield.csv"))
    assert figure.y.categories == ("largest strain", "all")
    assert figure.panels[0].series[0].low == (89, 93)
    assert figure.caption.startswith("91.2 % of 1000 made sensors meet all requirements.")


def test_requirements_and_conflicts_are_tables():
    record = {
        "requirements": [
            {"requirement": "force_z", "value": 5, "unit": "N", "state": "given"},
            {"requirement": "height", "value": None, "unit": "mm", "state": "free"},
        ],
        "winner": {"margins": {"force_z": 0.25}},
        "conflict": [],
    }
    (table,) = sizing_figures.sheets(record)
    assert {name: list(values) for name, values in table.columns.items()} == {
        "requirement": ["force z"],
        "value": [5],
        "unit": ["N"],
        "margin of the best variant (%)": [25.0],
    }
    assert sizing_figures.sheets({"requirements": 3}) == []
    conflict = {"winner": None, "conflict": [{"requirement": "range", "gives": "3.1 N"}]}
    assert [table.name for table in sizing_figures.sheets(conflict)] == ["Conflict"]
