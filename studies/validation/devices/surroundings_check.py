"""What surrounds a sensor, held against other codes: a turn after taring, a chip of reference, an iron block.

**Turns.** Each layout reads the magnet of a sensor that is tared at rest in the earth's field and then turned: the
field at its elements is magpylib's, under loads whose poses the mechanics give, and the field of the earth is turned
by random attitudes. What the decoder makes of it stands beside the worst of all directions by `magtip disturb`.

**A chip of reference** reads the ambient field at a distance, and its readings are taken off those of the sensor,
axis by axis. It is held against three fitted components (`--reject-ambient`): what a field gradient leaves, and the
field of the sensor's own magnet at the reference, and the noise of the force.

**An iron block** of a relative permeability under an axial magnet, by axisymmetric finite elements of the scalar
potential, beside the image of the magnet, over the distance.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analytic import surroundings
from analytic.decode import Decoder, decode, decoder
from analytic.hall import means_over_plates, plates_of
from analytic.inverse.ambient_field import directions
from analytic.parts import of_design
from analytic.surroundings import IronPlane, Poses
from geometry.arrays import Array
from geometry.design import Design, paper
from geometry.messages import Progress
from studies.inputs.user_input import toml_table
from studies.output.goals import Goal
from studies.output.result import Result
from studies.parts.requirements import LEAST_CHIPS
from studies.sensing.disturbances import DIRECTIONS
from studies.sensing.disturbed_loads import Loads, loads_of
from studies.simulation import mechanics_sources
from studies.validation import pages
from studies.validation.devices.winners import magpylib_field
from studies.validation.pages import Row

FILES = ("SURROUNDINGS.md", "surroundings.csv", "iron.csv")
PUBLISHED = Path(__file__).with_name("published_disturbances.toml")
EARTH, GRADIENT = 50e-6, 1e-6
"""Field of the earth at most places, T, and a gradient, T/mm."""
LAYOUTS: tuple[dict[str, Any], ...] = (
    {},
    {"hall_layout": "tlv493d-a1b6", "l0": 6.5},
    {"hall_layout": "tle493d-p2b6", "l0": 7.0},
    {"hall_layout": "tmag5273a1", "l0": 8.0},
    {"hall_layout": "tmag5170a1", "chip_x": 2.0},
    {"hall_layout": "mlx90393", "chip_x": 4.0},
    {"hall_layout": "als31300-1000", "l0": 9.0, "chip_x": 2.0},
    {"hall_layout": "tmag5273a1", "chip_count": 2.0, "chip_x": 4.0},
    {"hall_layout": "tmag5273a1", "chip_count": 3.0, "chip_x": 4.0},
    {"hall_layout": "tmag5273a1", "chip_count": 4.0, "chip_x": 6.0},
)
"""Ten layouts of the catalogue's parts, as fields of the paper's sensor."""
ATTITUDES, SEED = 200, 1
"""Random attitudes of a sensor, and their seed."""
REFERENCES = (3.0, 6.0)
"""Distances of the chip of reference from the axis, over D."""
STEP = 1e-8
"""Change of a reading for the slopes of the force, T."""
FACES = (4.0, 5.0, 6.0, 8.0, 12.0, 20.0)
"""Distances of the iron's face from the magnet's centre, mm; the magnet is 4 mm high and across."""
PERMEABILITIES = (1000.0, 100.0)


def run(progress: Progress, *, quick: bool = False) -> Result:
    """Turn tared sensors of ten layouts, and hold images against finite elements; exit status 3 if a goal is missed.

    Parameters
    ----------
    quick
        Three layouts and two distances.
    """
    chosen = [LAYOUTS[k] for k in (0, 3, 8)] if quick else list(LAYOUTS)
    faces = FACES[1:3] if quick else FACES
    law = mechanics_sources.source_of(paper()).law
    rows = [turned(replace(paper(), **each), law) for each in pages.told(progress, chosen, _name)]
    progress(0.9, "iron")
    iron = [iron_row(face, mu) for mu in PERMEABILITIES for face in faces]
    return result(rows, iron, quick=quick)


def _name(fields: dict[str, Any]) -> str:
    return str(fields.get("hall_layout", "three one-axis parts"))


def result(rows: list[Row], iron: list[Row], *, quick: bool) -> Result:
    """Return tables and page, with the goals of both."""
    ratios = [row["by_magpylib_N"] / row["turned_N"] for row in rows]
    fitted = [row["turned_rejected_N"] for row in rows if row["turned_rejected_N"] is not None]
    images = [abs(row["image_percent"]) for row in iron if row["permeability"] == PERMEABILITIES[0]]
    many = len(ratios)
    goals = [
        Goal("largest error by magpylib and turns, over that of all directions", max(ratios), 1.03, many),
        Goal("least one", min(ratios), 0.8, many, at_least=True),
        Goal("turned field that is fitted along", max(fitted, default=None), 1e-6, len(fitted), "N"),
        Goal("error of the image at a permeability of 1000", max(images), 1.0, len(images), "%"),
    ]
    named = toml_table(str(PUBLISHED), "file")["figure"]
    page = {"layouts": rows, "iron": iron, "published": named, "attitudes": ATTITUDES}
    found = pages.study("surroundings", "Surroundings", rows, page, goals=goals, run="quick" if quick else "full")
    return replace(found, tables={**found.tables, "iron": iron})


def turned(design: Design, law: Any) -> Row:
    """Return what a turn in the earth's field leaves of a tared sensor, N, and what takes it off at which price."""
    coder = decoder(design, law)
    loads, full, _ = loads_of(coder, None)
    plain = loads.readings(loads.poses.shift.T)
    normals = directions(coder.forward.elements)
    fields = EARTH * DIRECTIONS @ normals.T
    apart = (fields[:, None] - fields).reshape(-1, len(normals))
    row: Row = {
        "layout": design.hall_layout,
        "chips": int(design.chip_count) if design.hall_layout != "three" else None,
        "l0_mm": design.l0,
        "chip_x_mm": design.chip_x if design.hall_layout != "three" else None,
        "full_scale_N": full,
        "turned_N": worst(coder, plain + apart[:, None], loads),
        "by_magpylib_N": worst(coder, by_magpylib(design, loads), loads),
        "gradient_N": worst(coder, plain + of_gradients(design, coder), loads),
    }
    slopes = by_readings(coder, plain)
    for times in REFERENCES:
        row |= of_reference(times, design, coder, loads, slopes)
    several = design.hall_layout != "three" and design.chip_count >= LEAST_CHIPS
    row |= dict.fromkeys(("turned_rejected_N", "gradient_rejected_N", "noise_rejected"))
    if several:
        free = decoder(design, law, reject_ambient=True)
        row["turned_rejected_N"] = worst(free, plain + apart[:, None], loads)
        row["gradient_rejected_N"] = worst(free, plain + of_gradients(design, free), loads)
        row["noise_rejected"] = price(by_readings(free, plain), slopes, np.eye(len(normals)))
    return row


def worst(coder: Decoder, readings: Array, loads: Loads) -> float:
    """Return the largest error of the force, N, of readings (..., n, k), T, under the loads."""
    force = decode(coder, readings.reshape(-1, readings.shape[-1])).force
    error = np.linalg.norm(force.reshape(-1, *loads.force.shape) - loads.force, axis=-1)
    return float(np.nanmax(error)) if np.isfinite(error).any() else math.nan


def by_magpylib(design: Design, loads: Loads) -> Array:
    """Return readings (attitudes, n, k), T: magpylib's under the loads, in the earth's field, tared before a turn."""
    from scipy.spatial.transform import Rotation

    elements = of_design(design)
    points, owners = plates_of(elements)
    of_poses = [
        magpylib_field(points, design, np.tile(shift, (len(points), 1)), np.tile(tilt, (len(points), 1)))
        for shift, tilt in zip(loads.poses.shift, loads.poses.tilt, strict=True)
    ]
    read = means_over_plates(np.concatenate(of_poses), elements, owners).reshape(len(of_poses), -1)
    ways = Rotation.random(2 * ATTITUDES, rng=np.random.default_rng(SEED))
    seen = ways.apply([0.0, 0.0, EARTH]) @ directions(elements).T
    before, after = seen[:ATTITUDES], seen[ATTITUDES:]
    # taring takes off what a reading at rest has beyond the design's
    tare = read[0] + before - loads.readings(loads.poses.shift.T)[0]
    return np.asarray(read + (after - tare)[:, None])


def of_gradients(design: Design, coder: Decoder, reference: Array | None = None) -> Array:
    """Return what gradients of all directions add to the readings, (m, 1, k), T, less what a reference reads."""
    elements = coder.forward.elements
    points, owners = plates_of(elements)
    middle = points.mean(axis=0)
    rest = Poses(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros(1))
    found = []
    for v in DIRECTIONS:
        field = surroundings.gradient(GRADIENT * (3 * np.outer(v, v) - np.eye(3)) / 2, middle)
        read = means_over_plates(field(points, rest).reshape(-1, 3), elements, owners).reshape(1, -1)
        if reference is not None:
            read = read - field(reference[None], rest)[0] @ directions(elements).T
        found.append(read)
    return np.array(found)


def of_reference(times: float, design: Design, coder: Decoder, loads: Loads, slopes: Array) -> Row:
    """Return what a chip of reference leaves, N, and by which factor it raises the noise of the force."""
    place = np.array([times * design.D, 0.0, design.H - design.l0])
    normals, plain = directions(coder.forward.elements), loads.readings(loads.poses.shift.T)
    own = loads.poses.field(design, place[None])[:, 0] @ normals.T
    known = np.eye(len(normals)) + normals @ normals.T
    name = f"reference_{times:g}_D"
    return {
        f"{name}_own_field_N": worst(coder, (plain - (own - own[0]))[None], loads),
        f"{name}_gradient_N": worst(coder, plain + of_gradients(design, coder, place), loads),
        f"{name}_noise": price(slopes, slopes, known),
    }


def by_readings(coder: Decoder, plain: Array) -> Array:
    """Return the slopes of the force by the readings (n, 3, k), N/T."""
    sides = np.stack([plain[:, None] + way * STEP * np.eye(plain.shape[1]) for way in (1.0, -1.0)])
    force = decode(coder, sides.reshape(-1, plain.shape[1])).force.reshape(*sides.shape[:3], 3)
    return np.asarray((force[0] - force[1]).swapaxes(1, 2) / (2 * STEP))


def price(slopes: Array, before: Array, covariance: Array) -> float:
    """Return the noise of the force with a covariance of the readings over that of independent ones: the median."""
    now = np.einsum("nak,kl,nal->n", slopes, covariance, slopes)
    return float(np.sqrt(np.nanmedian(now / (before**2).sum(axis=(1, 2)))))


def block_field(permeability: float, face: float, points: Array) -> Array:
    """Return B_z, T, on the axis (z, mm) of an axial magnet of 1 T, 4 mm high and across, over an iron block.

    H = -grad phi, div (mu H + J) = 0, in a box so large that it does not matter to what the iron adds.

    face : height of the block's upper side over the magnet's centre, mm, below -2.
    """
    import skfem
    from skfem.helpers import dot, grad

    fine, far = np.arange(0, 6, 0.25), 6 * 1.1 ** np.arange(40)
    below = face - np.concatenate([[0.0], 0.25 * 1.12 ** np.arange(45)])
    r, z = np.unique([*fine, *far]), np.unique([*below, *np.linspace(face, 6, round(4 * (6 - face)) + 1), *far])
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(r, z), skfem.ElementQuad2(), intorder=4)

    @skfem.BilinearForm
    def stiffness(u, v, w):  # type: ignore[no-untyped-def]
        mu = np.where(w.x[1] < face, permeability, 1.0)
        return mu * dot(grad(u), grad(v)) * w.x[0]

    @skfem.LinearForm
    def poles(v, w):  # type: ignore[no-untyped-def]
        inside = (w.x[0] < 2.0) & (np.abs(w.x[1]) < 2.0)
        return inside * grad(v)[1] * w.x[0]

    outer = basis.get_dofs(lambda x: (x[0] > r[-1] - 1e-6) | (np.abs(x[1]) > 0.99 * min(-z[0], z[-1])))
    phi = skfem.solve(*skfem.condense(stiffness.assemble(basis), poles.assemble(basis), D=outer))
    step = 0.02
    low, high = (basis.probes(np.array([np.full(len(points), 1e-3), points + side])) @ phi for side in (-step, step))
    return np.asarray((low - high) / (2 * step))


def iron_row(face: float, permeability: float) -> Row:
    """Return what the iron adds half way between magnet and face, by finite elements and by the image, mT."""
    at = np.array([-(2.0 + face) / 2])
    (added,) = block_field(permeability, -face, at) - block_field(1.0, -face, at)
    # the design's north pole points down: its field is the reverse of that of a magnet along z
    magnet = replace(paper(), magnet_diameter=4.0, magnet_height=4.0, remanence=1.0, magnet_edge_radius=0.0)
    rest = Poses(np.zeros((1, 3)), np.zeros((1, 2)), np.zeros(1))
    plane = IronPlane(magnet, np.array([0.0, 0.0, magnet.H - face]), np.array([0.0, 0.0, 1.0]), permeability)
    image = -float(plane(np.array([[0.0, 0.0, magnet.H + at[0]]]), rest)[0, 0, 2])
    # of an iron without end, whatever its permeability
    endless = image * (permeability + 1) / (permeability - 1)
    return {
        "permeability": permeability,
        "face_mm": face,
        "added_mT": 1e3 * float(added),
        "image_mT": 1e3 * image,
        "image_percent": 100 * (image / float(added) - 1),
        "perfect_image_percent": 100 * (endless / float(added) - 1),
    }
