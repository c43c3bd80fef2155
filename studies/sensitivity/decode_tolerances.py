"""What the tolerances of parts do to a decoded force, and whether readings may be those of a made sensor at rest.

Three readings determine the three numbers of a pose: nearly every row has a pose without any residual, whichever made
sensor it comes from. So the decoder cannot tell that its nominal sensor is not the one that was read. It is
tested instead whether the row may be that of a made sensor at rest; a force decoded from such a row has the status
"uncalibrated" in place of "ok". With d its difference from the nominal sensor's
readings at rest and C the covariance of made sensors' readings there, noise included,

    chi^2 = d' C^-1 d,

the probability of a row is the share of made sensors at rest whose chi^2 is larger. (That of chi^2 with three
degrees of freedom would be wrong, since parts beyond their tolerances are sorted out.) The spread of a decoded force
is that of made sensors in the decoded pose, whose readings are decoded as if they were the nominal sensor's. More
than three readings leave a residual, which the decoder tests (`deviation` of `analytic.decode.decoder`). Where it
rejects an ambient field, rows and made sensors are compared without what a uniform field explains.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.decode import Status, decode
from analytic.inverse.ambient_field import range_of
from analytic.parts import common_values
from geometry.design import BadInput
from studies.output import page_templates
from studies.parts.part_tolerances import Tolerances, tolerances
from studies.sensing.decode_readings import WHY
from studies.sensitivity.made_sensors import MadeSensors, made_readings, made_sensors, nominal_sensor

if TYPE_CHECKING:
    from analytic.array_stream import Frame
    from analytic.decode import Decoded, Decoder
    from geometry.arrays import Array

SENSORS = 400
"""Number of made sensors: a standard deviation is then known to 4 %."""
DOUBTFUL = 0.05
"""Probability from which a row may be that of a made sensor at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class ToleranceCheck:
    """Effect of tolerances on decoded rows.

    Attributes
    ----------
    rest_probability : share of made sensors at rest that differ more from the nominal one than each row, shape (n,);
        NaN for a row without readings.
    row, tolerance_N : number of the row with the largest force, None without a force; standard deviations of its
        force over made sensors.
    lost : made sensors whose readings in its pose have no pose, or no force.
    """

    status: list[Status]
    rest_probability: Array
    row: int | None
    tolerance_N: list[float]
    lost: int

    def warnings(self, force: Array) -> list[str]:
        """Return a sentence on decoded forces, shape (n, 3), N, if a sensor at rest may have given the readings."""
        alike = int((self.rest_probability >= DOUBTFUL).sum())
        size = math.nan if self.row is None else float(np.linalg.norm(force[self.row]))
        template = Path(__file__).with_name("sentences.j2")
        return page_templates.sentences(template, "at_rest", check=self, alike=alike, size=size, sensors=SENSORS)

    def of_one(self, row: Mapping[str, Any], force: Array) -> dict[str, Any]:
        """Return the row of one decoded set of readings with this check added; `force` has shape (1, 3), N."""
        size = float(np.linalg.norm(force[0]))
        return {
            **row,
            "status": self.status[0],
            "message": row["message"] or WHY[self.status[0]],
            "rest_probability": float(self.rest_probability[0]),
            "tolerance_N": self.tolerance_N or None,
            "tolerance_N_per_N": [value / size for value in self.tolerance_N] or None,
            "warnings": row["warnings"] + self.warnings(force),
        }


class AtRest:
    """The test of rows against made sensors at rest: C^-1 of their readings, 1/T^2, and their chi^2, ascending."""

    def __init__(self, coder: Decoder, sizes: Tolerances = tolerances()) -> None:
        design = coder.forward.design
        self.made, self.nominal = made_sensors(design, sizes, SENSORS), nominal_sensor(design)
        self._rest, deviations = _read(self.nominal, self.made, np.zeros(3), np.zeros(2))
        noise = [element.noise_T for element in coder.forward.elements]
        deviations = deviations + np.random.default_rng(0).normal(0.0, noise, deviations.shape)
        for element, spread in zip(coder.forward.elements, np.ptp(deviations, axis=0).tolist(), strict=True):
            if not spread > 0:
                raise BadInput(
                    f"{element.name} reads the same in all made sensors at rest, as it does at a rail or without "
                    "tolerances: set hall_gain and its rails so that it reads the magnet, or leave a tolerance"
                )
        free = coder.goal.free
        basis = range_of(free).T @ free if len(free) else np.eye(deviations.shape[1])
        left = deviations @ basis.T
        self.inverse: Array = np.asarray(basis.T @ np.linalg.inv(left.T @ left / len(left)) @ basis, dtype=float)
        self.of_made = np.sort(self._squares(deviations))

    def _squares(self, deviations: Array) -> Array:
        return np.asarray(np.einsum("ni,ij,nj->n", deviations, self.inverse, deviations))

    def probability(self, field: Array) -> Array:
        """Return the share of made sensors at rest that differ more than each row (n, k), T; NaN without readings."""
        squares = self._squares(field - self._rest)
        larger = len(self.of_made) - np.searchsorted(self.of_made, squares, side="right")
        return np.where(np.isnan(squares), np.nan, larger / len(self.of_made))

    def status(self, word: Status, probability: float, force: float) -> Status:
        """Return the status of a row by its force, N, and its probability: uncalibrated in place of ok."""
        return "uncalibrated" if word == "ok" and force > 0 and probability >= DOUBTFUL else word


def frame_statuses(coder: Decoder, sizes: Tolerances = tolerances()) -> Callable[[Frame], list[Status]]:
    """Return the function from a frame of an array to the statuses of its beams, each tested as a single sensor."""
    at_rest = AtRest(coder, sizes)

    def statuses(frame: Frame) -> list[Status]:
        shares, forces = at_rest.probability(frame.own), np.linalg.norm(frame.force, axis=1)
        words = zip(frame.status, shares.tolist(), forces.tolist(), strict=True)
        return [at_rest.status(*word) for word in words]

    return statuses


def check(coder: Decoder, field: Array, decoded: Decoded, sizes: Tolerances = tolerances()) -> ToleranceCheck:
    """Compare decoded rows, readings B.n (n, 3), T, of a design's own three elements with made sensors of it."""
    at_rest = AtRest(coder, sizes)
    probability, size = at_rest.probability(field), np.linalg.norm(decoded.force, axis=1)
    status = [at_rest.status(*row) for row in zip(decoded.status, probability, size, strict=True)]
    if not (size > 0).any():
        return ToleranceCheck(status, probability, None, [], 0)
    row = int(np.nanargmax(size))
    deviations = _read(at_rest.nominal, at_rest.made, decoded.shift[row], decoded.tilt[row])[1]
    found = decode(coder, field[row] + deviations, near=decoded.shift[row])
    has_force = np.isfinite(found.force[:, 2])
    spread = (found.force[has_force] - decoded.force[row]).T
    tolerance = np.sqrt((spread**2).mean(axis=1)) if has_force.any() else np.full(3, np.nan)
    return ToleranceCheck(status, probability, row, tolerance.tolist(), int((~has_force).sum()))


def _read(
    nominal: MadeSensors, made: MadeSensors, shift: Sequence[float] | Array, tilt: Array
) -> tuple[Array, Array]:
    """Return the nominal sensor's readings in a pose, shape (3,), and made sensors' deviations from it, (n, 3), T."""
    gain, null, *_ = common_values(nominal.nominal)

    def fields(sensors: MadeSensors) -> Array:
        count = len(sensors)
        poses = np.broadcast_to(shift, (count, 1, 3)), np.broadcast_to(tilt, (count, 1, 2))
        return np.asarray((made_readings(sensors, *poses).output[:, 0] - null) / gain)

    nominal_field = fields(nominal)[0]
    deviations = fields(made) - nominal_field
    return nominal_field, deviations[np.isfinite(deviations).all(axis=1)]
