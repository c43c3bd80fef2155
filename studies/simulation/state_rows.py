"""The rows of solved states and of the formulas, under the names that `magtip solve` and `magtip analytic` print."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from geometry import design_digest
from geometry.design_digest import Fields
from geometry.loads import Load, Response
from studies.output import records
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from analytic.hall import Readings
    from fem.solution import Facts, Solution
    from studies.surrogate.surrogate_response import Estimate


@dataclass(frozen=True, slots=True)
class LoadColumns:
    """A load: the motion of the plate or grip, its tilt, the imperfection, and how the tip is held.

    Attributes
    ----------
    friction : "none", "stick" or a coefficient; None for a grip.
    grip_mm : height of the gripped skin; None under a plate.
    """

    depth_mm: float
    shear_mm: float
    shear_y_mm: float
    plate_tilt_rad: float
    imperfection_N: float
    friction: float | str | None
    grip_mm: float | None


@dataclass(frozen=True, slots=True)
class ResponseColumns:
    """The response to a load: force on the tip, pose of the magnet, contact radius; all None for an unsolved state.

    Force and shift are vectors (x, y, z); the rotation is the vector about x and y.
    """

    force_N: list[float] | None = None
    shift_mm: list[float] | None = None
    tilt_rad: float | None = None
    tilt_y_rad: float | None = None
    rotation_rad: list[float] | None = None
    contact_radius_mm: float | None = None


@dataclass(frozen=True, slots=True)
class FactColumns:
    """Facts of a state that its message puts in words (see `fem.solution.Facts`); None for a fact that is unknown.

    Attributes
    ----------
    onset_depth_from_mm, onset_depth_to_mm : interval of depths in which the path became unstable.
    onset_shear_from_mm, onset_shear_to_mm : the same for a path along which the shear grows.
    """

    stop: str | None = None
    remark: str | None = None
    stability: str | None = None
    unstable_directions: int | None = None
    onset_depth_from_mm: float | None = None
    onset_depth_to_mm: float | None = None
    onset_shear_from_mm: float | None = None
    onset_shear_to_mm: float | None = None
    unstable_stretches: list[float] | None = None
    inside_out_share: float | None = None
    sideways_stiffness_ratio: float | None = None
    critical_depth_mm_estimate: float | None = None
    crease_ratio: float | None = None
    largest_strain_percent: float | None = None


FACTS = tuple(column.name for column in dataclasses.fields(FactColumns))
"""Names of the columns that repeat the message."""


@dataclass(frozen=True, slots=True)
class StateRow:
    """One state of a path by finite elements.

    Attributes
    ----------
    dissipated_mJ : energy dissipated by slip on the plate since the start of the path.
    digest, made_for : label of the sensor, so that a reader of the row can refuse another sensor.
    """

    status: str
    message: str
    model: str
    load: LoadColumns = field(metadata={"prefix": ""})
    response: ResponseColumns = field(metadata={"prefix": ""})
    slip_share: float | None
    dissipated_mJ: float | None
    error_estimate: float | None
    shift_error_estimate: float | None
    tilt_error_estimate: float | None
    sideways_error_estimate: float | None
    dofs: int
    newton_iterations: int
    seconds: float
    facts: FactColumns = field(metadata={"prefix": ""})
    digest: str
    made_for: Fields

    def row(self) -> FlatRow:
        """Return the flat row for tables and JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class FormulaRow:
    """The response by formulas, with the readings of the Hall elements.

    Attributes
    ----------
    readings_T, saturated : one value for each element; None without a magnet.
    readings_V, output_T : outputs of elements whose unit is V, or of a chip in T; the other is None.
    warnings : saturated elements and collisions, in sentences.
    """

    status: str
    message: str
    level: str
    load: LoadColumns = field(metadata={"prefix": ""})
    response: ResponseColumns = field(metadata={"prefix": ""})
    readings_T: list[float] | None
    readings_V: list[float] | None
    output_T: list[float] | None
    saturated: list[bool] | None
    warnings: list[str]
    digest: str
    made_for: Fields

    def row(self) -> FlatRow:
        """Return the flat row for JSON and for the terminal."""
        return records.flat(self)


def solved_row(state: Solution, made_for: Fields) -> StateRow:
    """Return the row of a solved state; `made_for` holds the fields of the design that the state depends on."""
    return StateRow(
        status=state.status,
        message=state.message,
        model=state.model,
        load=_load_columns(state.load),
        response=_response_columns(state.response),
        slip_share=state.slip_share,
        dissipated_mJ=state.dissipated,
        error_estimate=state.estimates.force,
        shift_error_estimate=state.estimates.shift,
        tilt_error_estimate=state.estimates.tilt,
        sideways_error_estimate=state.estimates.sideways,
        dofs=state.dofs,
        newton_iterations=state.newton_iterations,
        seconds=state.seconds,
        facts=_fact_columns(state.facts),
        digest=design_digest.digest(made_for),
        made_for=made_for,
    )


def formula_state_row(load: Load, response: Response, model: str, seconds: float, made_for: Fields) -> StateRow:
    """Return the row of a state by formulas, in the columns of finite elements; `model` names their level."""
    return StateRow(
        status="ok",
        message="",
        model=model,
        load=_load_columns(load),
        response=_response_columns(response),
        slip_share=None,
        dissipated_mJ=None,
        error_estimate=None,
        shift_error_estimate=None,
        tilt_error_estimate=None,
        sideways_error_estimate=None,
        dofs=0,
        newton_iterations=0,
        seconds=seconds,
        facts=FactColumns(),
        digest=design_digest.digest(made_for),
        made_for=made_for,
    )


def surrogate_state_row(load: Load, estimate: Estimate, model: str, seconds: float, made_for: Fields) -> StateRow:
    """Return the row of a state by the surrogate: its error estimates are the half widths of its 90 % intervals."""
    return dataclasses.replace(
        formula_state_row(load, estimate.response, model, seconds, made_for),
        message=surrogate_message(estimate),
        error_estimate=estimate.force_error,
        shift_error_estimate=estimate.shift_error,
        tilt_error_estimate=estimate.tilt_error,
        sideways_error_estimate=estimate.sideways_error,
        facts=FactColumns(largest_strain_percent=100 * estimate.strain),
    )


def surrogate_message(estimate: Estimate) -> str:
    """Return which model a state is from, and its 90 % intervals, in a sentence."""
    widths = {"force": estimate.force_error, "shift": estimate.shift_error, "tilt": estimate.tilt_error}
    widths["force along the shear"] = estimate.sideways_error
    shown = ", ".join(f"{name} +-{100 * width:.2g} %" for name, width in widths.items() if width is not None)
    return f"by the surrogate; 90 % intervals: {shown}"


def unsolved_row(load: Load, model: str, message: str, made_for: Fields) -> StateRow:
    """Return the row of a load that has no solution because its mesh cannot be made."""
    return StateRow(
        status="not_converged",
        message=message,
        model=model,
        load=_load_columns(load),
        response=ResponseColumns(),
        slip_share=None,
        dissipated_mJ=None,
        error_estimate=None,
        shift_error_estimate=None,
        tilt_error_estimate=None,
        sideways_error_estimate=None,
        dofs=0,
        newton_iterations=0,
        seconds=0.0,
        facts=FactColumns(stop="no_mesh"),
        digest=design_digest.digest(made_for),
        made_for=made_for,
    )


def formula_row(
    load: Load,
    response: Response,
    readings: Readings | None,
    *,
    level: str,
    message: str,
    warnings: list[str],
    made_for: Fields,
) -> FormulaRow:
    """Return the row of the formulas of a level; `readings` is None without a magnet."""
    volts = readings is not None and set(readings.units) == {"V"}
    return FormulaRow(
        status="ok",
        message=message,
        level=level,
        load=_load_columns(load),
        response=_response_columns(response),
        readings_T=None if readings is None else list(readings.B_T),
        readings_V=list(readings.output) if readings and volts else None,
        output_T=list(readings.output) if readings and not volts else None,
        saturated=None if readings is None else list(readings.saturated),
        warnings=warnings,
        digest=design_digest.digest(made_for),
        made_for=made_for,
    )


def _load_columns(load: Load) -> LoadColumns:
    friction = None if load.grip is not None else load.friction
    return LoadColumns(
        load.depth, load.shear_x, load.shear_y, load.plate_tilt, load.imperfection, friction, load.grip
    )


def _response_columns(response: Response) -> ResponseColumns:
    return ResponseColumns(
        list(response.force),
        list(response.shift),
        response.tilt,
        response.tilt_y,
        list(response.rotation),
        response.contact_radius,
    )


def _fact_columns(facts: Facts) -> FactColumns:
    # the onset is an interval of the depth or of the shear, whichever grew along the path
    onset = facts.onset_mm or (None, None)
    depth = onset if facts.onset == "depth" else (None, None)
    shear = onset if facts.onset == "shear" else (None, None)
    return FactColumns(
        stop=facts.stop or None,
        remark=facts.remark,
        stability=facts.verdict,
        unstable_directions=facts.stability.directions,
        onset_depth_from_mm=depth[0],
        onset_depth_to_mm=depth[1],
        onset_shear_from_mm=shear[0],
        onset_shear_to_mm=shear[1],
        unstable_stretches=None if facts.weak_at is None else list(facts.weak_at),
        inside_out_share=facts.inverted_share,
        sideways_stiffness_ratio=facts.sideways_stiffness_ratio,
        critical_depth_mm_estimate=facts.critical_depth,
        crease_ratio=facts.crease_ratio,
        largest_strain_percent=None if facts.largest_strain is None else 100 * facts.largest_strain,
    )
