"""Readings of the Hall elements in a study's cases, and the forces that the formulas decode from them."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.batch_readings import batch_readings
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.mechanics.study_cases import Batch, Columns, Plan, Recent
from studies.sensing.field_readings import columns as element_columns
from studies.sweeps.model_results import NAN, Results, error_prefix, percents, prefixes, ratio

MOST_DECODERS = 16
"""Number of decoders that are kept, some MB each."""


class StudyReadings:
    """Computes the readings of batches of one study."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.prefixes = prefixes(plan)
        self._decoders: Recent[Any] = Recent(MOST_DECODERS)

    def columns(self, batch: Batch, results: Mapping[str, Results]) -> Columns:
        """Return fields and outputs of the elements by all models, and errors in % of the change from rest.

        If the layout varies, the columns of one layout are empty in the rows of another.
        """
        n = len(batch)
        rest = self._read(batch, np.zeros((n, 3)), np.zeros((n, 2)))[0]
        read = {name: self._read(batch, result.shift, result.rotation) for name, result in results.items()}
        table: Columns = {}
        for (names, unit), layouts in self._layouts().items():
            other = np.array([design is None or design.hall_layout not in layouts for design in batch.sensors])
            table |= self._of_layout(names, unit, other[batch.sensor], rest, read)
        return table

    def _layouts(self) -> dict[tuple[tuple[str, ...], str], list[str]]:
        """Return names of elements and unit of their outputs, with the study's layouts that have them."""
        base = self.plan.design
        values = [dict(zip(f.names, f.values, strict=True)).get("hall_layout", ()) for f in self.plan.factors]
        layouts = list(dict.fromkeys(str(name) for each in values for name in each)) or [base.hall_layout]
        groups: dict[tuple[tuple[str, ...], str], list[str]] = {}
        for layout in layouts:
            names, unit = element_columns(replace(base, hall_layout=layout))
            groups.setdefault((tuple(names), unit), []).append(layout)
        return groups

    def _of_layout(
        self,
        names: Sequence[str],
        unit: str,
        other: NDArray[np.bool_],
        rest: Array,
        read: Mapping[str, tuple[Array, Array]],
    ) -> Columns:
        """Return the columns of one layout; `other` marks the cases, shape (n,), that have another one."""
        size = 1.0 if unit == "V" else 1e3
        shown = names if self.plan.loads_sideways else names[:2]
        table: Columns = {}
        for k, element in enumerate(shown):
            for name, (field, _) in read.items():
                table[f"{self.prefixes[name]}{element}_mT"] = np.where(other, NAN, 1e3 * field[:, k])
            for name, (_, output) in read.items():
                table[f"{self.prefixes[name]}{element}_{unit}"] = np.where(other, NAN, size * output[:, k])
            if not self.plan.truth:
                continue
            truth = read[self.plan.truth][0][:, k] - rest[:, k]
            for name, (field, _) in read.items():
                if name != self.plan.truth:
                    column = f"{error_prefix(self.plan, name)}{element}_error_percent_of_change"
                    table[column] = np.where(other, NAN, percents(field[:, k] - rest[:, k], truth))
        return table

    def _read(self, batch: Batch, shift: Array, rotation: Array) -> tuple[Array, Array]:
        """Return fields, T, and outputs of the elements in the cases, shape (n, 3)."""
        if not any(design is not None and design.shape.has_magnet for design in batch.sensors):
            return np.full((len(batch), 3), NAN), np.full((len(batch), 3), NAN)
        possible = np.array([design is not None for design in batch.sensors])
        designs = [design or self.plan.design for design in batch.sensors]
        shift = np.where(possible[batch.sensor][:, None], shift, NAN)
        readings = batch_readings(designs, batch.sensor, shift, rotation)
        return readings.field_T, readings.output

    def decoded(self, batch: Batch, results: Mapping[str, Results]) -> Columns:
        """Return the forces that each formula level decodes from the reference's readings, and their errors."""
        table: Columns = {}
        reference = self.plan.reference
        assert reference is not None
        truth = results[reference.name]
        output = self._read(batch, truth.shift, truth.rotation)[1]
        for level in self.plan.formulas:
            force = np.full((len(batch), 3), NAN)
            for k, design in enumerate(batch.sensors):
                rows = np.flatnonzero((batch.sensor == k) & np.isfinite(output).all(axis=1))
                decoder = self._decoder(level, design) if design is not None and len(rows) else None
                if decoder is not None:
                    from analytic.decode import decode, field_of

                    force[rows] = decode(decoder, field_of(decoder.forward.elements, output[rows])).force
            force = force * (batch.E / self.plan.design.E)[:, None]
            difference = np.linalg.norm(force - truth.force, axis=1)
            prefix = f"decoded_{level}_" if len(self.plan.formulas) > 1 else "decoded_"
            table[f"{prefix}force_N"] = force[:, 2]
            table[f"{prefix}force_error_N"] = difference
            size = np.linalg.norm(truth.force, axis=1)
            table[f"{prefix}force_error_percent"] = 100 * ratio(difference, size)
        return table

    def _decoder(self, level: str, design: Design) -> Any:
        """Return the decoder of a sensor at the base design's E, or None if it cannot be made."""
        from analytic.decode import decoder
        from studies.sensing.decode_readings import of_level

        def make() -> Any:
            with contextlib.suppress(BadInput):
                return decoder(design, of_level(design, level))
            return None

        return self._decoders.get((level, design), make)
