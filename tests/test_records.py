"""Rows of tables from typed records."""

from __future__ import annotations

from dataclasses import dataclass, field

from studies.output import records


@dataclass(frozen=True, slots=True)
class Motion:
    shift_mm: tuple[float, float]
    tilt_rad: float


@dataclass(frozen=True, slots=True)
class Case:
    name: str
    magtip: Motion | None = field(metadata={"prefix": ""})
    peer: Motion | None = field(metadata={"prefix": "peer_"})
    error: float | None = field(default=None, metadata={"column": "error, %"})
    origin: Motion = Motion((0.0, 0.0), 0.0)


def test_columns_come_in_the_order_of_fields_those_of_records_in_their_place() -> None:
    row = records.flat(Case("press", Motion((1.0, 2.0), 0.1), Motion((1.5, 2.5), 0.2), 3.0))
    names = ["name", "shift_mm", "tilt_rad", "peer_shift_mm", "peer_tilt_rad", "error, %", "origin"]
    assert list(row) == names
    assert list(row.values()) == ["press", (1.0, 2.0), 0.1, (1.5, 2.5), 0.2, 3.0, Motion((0.0, 0.0), 0.0)]


def test_a_record_that_is_not_there_has_no_columns_but_a_value_that_is_not_there_has_one() -> None:
    row = records.flat(Case("press", None, Motion((0.0, 0.0), 0.0)))
    assert list(row) == ["name", "peer_shift_mm", "peer_tilt_rad", "error, %", "origin"]
    assert row["error, %"] is None


def test_known_leaves_out_none_only() -> None:
    assert list(records.known({"a": None, "b": 0.0, "c": "", "d": False})) == ["b", "c", "d"]


def test_a_value_may_make_its_own_columns() -> None:
    @dataclass(frozen=True, slots=True)
    class Readings:
        depth_mm: float
        fields: dict[str, float] = field(
            metadata={"columns": lambda fields: {f"{k}_mT": v for k, v in fields.items()}}
        )
        status: str = "ok"

    row = records.flat(Readings(0.5, {"S1": 3.0, "S2": 4.0}))
    assert list(row.items()) == [("depth_mm", 0.5), ("S1_mT", 3.0), ("S2_mT", 4.0), ("status", "ok")]
