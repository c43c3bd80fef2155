"""Meshes from elsewhere: tetrahedra in any format that meshio reads, checked against the design's exact bodies.

The frame is the sensor's (base at z = 0, beam along +z, mm). A half body lies in y >= 0. Linear tetrahedra are curved
to the exact surfaces as those of `geometry.mesh` are; quadratic ones stay as they are. Regions are named "silicone"
and "magnet" (physical groups, cell sets or tags, upper case or lower, or the cells' number `region` as magtip writes
it, 0 and 1); without names, cells within the magnet are the magnet. A mesh without cells there has the magnet as a
hole. Facets are found from where they lie; sets of facets named "base", "skin", "symmetry" or "magnet" must agree.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet1, MeshTet2

from geometry import design_digest
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Shape
from geometry.mesh import Parts
from geometry.meshing import curved_mesh, exact_surfaces
from geometry.meshing.edge_lengths import Sizes
from geometry.meshing.mesh_quality import quality

OFF = 5e-3
"""Greatest distance of a node from the surface that it is on, in D."""
VOLUME = 2e-3
"""Greatest relative error of a region's volume."""
SIDES = ("base", "skin", "symmetry", "magnet")
REGIONS = ("silicone", "magnet")
KINDS = {"tetra": 4, "tetra10": 10}


@dataclass(frozen=True, slots=True)
class _Cells:
    """Tetrahedra as they stand in a file.

    Attributes
    ----------
    points : shape (n, 3), mm.
    cells : indices of points, shape (m, 4) or (m, 10), corners first, in VTK's order.
    region : number of each cell's region in REGIONS, or -1 where it has no name.
    sides : corners of the facets that carry a side's name, shape (k, 3).
    text : the file's name, for messages.
    """

    points: Array
    cells: Ints
    region: Ints
    sides: dict[str, Ints]
    text: str


def read(
    path: str | Path, shape: Shape, magnet: Parts = "regions", warn: Callable[[str], None] | None = None
) -> MeshTet2:
    """The mesh in a file, mm, with boundaries and subdomains as `geometry.mesh.tetrahedra` gives them.

    Parameters
    ----------
    magnet : "regions" keeps it, if there are cells in it; "hole" leaves them out; "none" takes all for silicone.
    warn : takes a sentence about a file that does not say for which sensor it was made, as `magtip mesh` lets it.

    Raises
    ------
    BadInput
        The file cannot be read, was made for another sensor, has no tetrahedra or others than linear or quadratic
        ones, a cell is inverted, names and places disagree, or the mesh does not conform, leaves gaps or is one of
        another design.
    """
    text = repr(str(path))
    content = _opened(path, text)
    needed = design_digest.of_solid(shape, magnet=magnet != "none")
    if not design_digest.check(_label(content), needed, f"the mesh {text}") and warn is not None:
        warn(
            f"the mesh {text} does not say for which sensor it was made: only its surfaces (to {100 * OFF:g} % of D) "
            f"and volumes (to {100 * VOLUME:g} %) are checked"
        )
    given = _checked(_parsed(content, text), shape)
    region = _regions(given, shape)
    if magnet == "none":
        shape, region = shape.without_magnet(), np.zeros_like(region)
    elif magnet == "hole":
        given = replace(given, cells=given.cells[region == 0])
        region = region[region == 0]
    straight, corner = _straight(given, region)
    straight = _sided(straight, given, corner, shape)
    mesh = _linear(straight, given, shape) if given.cells.shape[1] == 4 else _quadratic(straight, given)
    for name, error in quality(mesh, shape).volume_errors.items():
        if not abs(error) < VOLUME:
            raise BadInput(
                f"the volume of the {name} in the mesh {given.text} is wrong by {100 * error:.3g} % (at most "
                f"{100 * VOLUME:g} % is allowed): mesh this design, without gaps or overlaps"
            )
    return mesh


def _opened(path: str | Path, text: str) -> Any:
    import meshio

    if not Path(path).is_file():
        raise BadInput(f"there is no file {text}: check its path")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        # its readers end in whatever way a broken file leads them to
        reason = "damaged or truncated" if isinstance(error, SystemExit) else str(error) or type(error).__name__
        raise BadInput(f"meshio cannot read the mesh {text} ({reason}): save it in another format") from None


def _label(content: Any) -> dict[str, Any]:
    """What the file says of itself."""
    single = {name: np.ravel(values)[0] for name, values in content.field_data.items() if np.size(values) == 1}
    return design_digest.from_numbers(single)


def _parsed(content: Any, text: str) -> _Cells:
    """What is there of tetrahedra and names."""
    others = set(content.cells_dict) - {*KINDS, "vertex", "line", "line3", "triangle", "triangle6"}
    kinds = [kind for kind in KINDS if kind in content.cells_dict]
    if others or len(kinds) != 1:
        found = ", ".join(sorted(content.cells_dict)) or "no cells"
        raise BadInput(f"the mesh {text} must consist of tetrahedra, all linear or all quadratic; got {found}")
    kind = kinds[0]
    cells = np.asarray(content.cells_dict[kind], dtype=np.int64)
    named = _named(content)
    region = np.full(len(cells), -1)
    for k, name in enumerate(REGIONS):
        region[named.get(name, {}).get(kind, [])] = k
    numbers = content.cell_data_dict.get("region", {}).get(kind)
    if numbers is not None and (region < 0).all():
        region = np.where(np.isin(numbers, (0, 1)), np.asarray(numbers), -1).astype(np.int64).ravel()
    sides = {}
    for name in SIDES:
        facets = [
            np.asarray(content.cells_dict[facet])[index, :3]
            for facet, index in named.get(name, {}).items()
            if facet in ("triangle", "triangle6")
        ]
        if facets:
            sides[name] = np.vstack(facets).astype(np.int64)
    return _Cells(np.asarray(content.points, dtype=np.float64), cells, region, sides, text)


def _named(content: Any) -> dict[str, dict[str, Ints]]:
    """Indices of cells by the name of their set, physical group or tag, in lower case, and by their kind."""
    found: dict[str, dict[str, Ints]] = {}
    for name, by_kind in content.cell_sets_dict.items():
        found.setdefault(name.lower(), {}).update(by_kind)
    tags: list[tuple[str, int, str]] = [
        (name, int(tag[0]), "gmsh:physical") for name, tag in content.field_data.items()
    ]
    tags += [(name, tag, "cell_tags") for tag, names in getattr(content, "cell_tags", {}).items() for name in names]
    for name, tag, data in tags:
        for kind, numbers in content.cell_data_dict.get(data, {}).items():
            found.setdefault(name.strip().lower(), {}).setdefault(kind, np.flatnonzero(np.asarray(numbers) == tag))
    return found


def _checked(given: _Cells, shape: Shape) -> _Cells:
    """The same with all cells upright, if numbers and measures make sense."""
    points, cells, text = given.points, given.cells, given.text
    if not len(cells) or cells.min() < 0 or cells.max() >= len(points) or points.shape[1] != 3:
        raise BadInput(f"the cells of the mesh {text} refer to points that do not exist: export it again")
    used = points[cells[:, :4]]
    if not np.isfinite(used).all():
        raise BadInput(f"the mesh {text} has coordinates that are not finite numbers: export it again")
    high = float(used[..., 2].max())
    if not abs(high - shape.L) < OFF * shape.D:
        raise BadInput(
            f"the mesh {text} reaches up to z = {high:.6g} mm, but this design to L = {shape.L:g} mm: give a mesh of "
            "this design in mm, with its base at z = 0 and the beam along +z"
        )
    sides = used[:, 1:] - used[:, :1]
    six = np.linalg.det(sides)
    flat = np.abs(six) < 1e-9 * np.abs(sides).max(axis=(1, 2)) ** 3
    if flat.any():
        raise BadInput(f"{flat.sum()} of {len(cells)} cells of the mesh {text} are flat: mesh it again")
    turned = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8][: cells.shape[1]]
    return replace(given, cells=np.where((six < 0)[:, None], cells[:, turned], cells))


def _regions(given: _Cells, shape: Shape) -> Ints:
    """The number of each cell's region, from its name or else from its place."""
    centres = given.points[given.cells[:, :4]].mean(axis=1).T
    depth = exact_surfaces.magnet(centres, shape).distance if shape.has_magnet else np.ones(len(given.cells))
    place = (depth < 0).astype(np.int64)
    if (given.region < 0).all():
        return place
    if (given.region < 0).any():
        count = int((given.region < 0).sum())
        raise BadInput(
            f"{count} of {len(place)} cells of the mesh {given.text} belong to neither of the regions silicone and "
            f"magnet: assign a region to every cell, or to none"
        )
    wrong = (place != given.region) & (np.abs(depth) > OFF * shape.D)
    if wrong.any():
        raise BadInput(
            f"{int(wrong.sum())} of {len(place)} cells of the mesh {given.text} are assigned to the wrong region: "
            f"check the names of the regions, and that this is a mesh of this design"
        )
    return given.region


def _straight(given: _Cells, region: Ints) -> tuple[MeshTet1, Ints]:
    """Linear cells with their regions, and the number of each point among their corners (-1: none)."""
    used, t = np.unique(given.cells[:, :4], return_inverse=True)
    corner = np.full(len(given.points), -1)
    corner[used] = np.arange(len(used))
    parts = {name: np.flatnonzero(region == k) for k, name in enumerate(REGIONS) if (region == k).any()}
    p, t = np.ascontiguousarray(given.points[used].T), np.ascontiguousarray(t.reshape(-1, 4).T)
    facets = np.sort(t[[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].transpose(0, 2, 1).reshape(-1, 3), axis=1)
    if np.unique(facets, axis=0, return_counts=True)[1].max() > 2:
        raise BadInput(f"the cells of the mesh {given.text} overlap: more than two share a facet")
    return MeshTet1(p, t, _subdomains=parts, sort_t=False), corner


def _sided(mesh: MeshTet1, given: _Cells, corner: Ints, shape: Shape) -> MeshTet1:
    """The mesh with its boundaries, found from where facets lie, and compared with the names that they carry."""
    near = OFF * shape.D
    half = bool(mesh.p[1].min() > -near)
    mesh = curved_mesh.labelled(mesh, near, half)
    rest = mesh.boundaries["skin"]

    def on(about: curved_mesh.About, body: Shape) -> NDArray[np.bool_]:
        return np.asarray((np.abs(about(mesh.p, body).distance) < near)[mesh.facets[:, rest]].all(axis=0))

    skin, hole = on(exact_surfaces.skin, shape), np.zeros(len(rest), dtype=bool)
    if shape.has_magnet:
        hole = (
            on(exact_surfaces.magnet, shape) | on(exact_surfaces.magnet, replace(shape, magnet_edge_radius=0.0))
        ) & ~skin
    lost = rest[~skin & ~hole]
    if len(lost) or (hole.any() and "magnet" in mesh.subdomains):
        where = mesh.p[:, mesh.facets[:, (lost if len(lost) else rest[hole])[0]]].mean(axis=1)
        raise BadInput(
            f"the mesh {given.text} has an outer facet at ({where[0]:.4g}, {where[1]:.4g}, {where[2]:.4g}) mm that "
            f"lies on no outer surface of this design (within {near:.3g} mm): merge equal nodes, so that it "
            "conforms, or mesh this design"
        )
    sides = dict(mesh.boundaries) | {"skin": rest[skin]}
    if hole.any():
        sides["magnet"] = rest[hole]
    for name, facets in given.sides.items():
        _agree(name, mesh, sides.get(name, rest[:0]), corner[facets], given.text)
    return replace(mesh, _boundaries=sides)


def _agree(name: str, mesh: MeshTet1, found: Ints, named: Ints, text: str) -> None:
    """Refuse names of facets that do not match where they lie."""
    places = {tuple(sorted(facet)) for facet in mesh.facets[:, found].T.tolist()}
    names = {tuple(sorted(facet)) for facet in named.tolist()}
    if places != names:
        raise BadInput(
            f"the mesh {text} lists {len(names)} facets as {name}, but {len(places)} facets lie on that surface "
            f"({len(places & names)} are in both): correct that set, or leave it out"
        )


def _linear(mesh: MeshTet1, given: _Cells, shape: Shape) -> MeshTet2:
    """The mesh of second order on the exact surfaces."""
    made = curved_mesh.curved(mesh, _sizes(mesh, shape), shape)
    if made is None:
        raise BadInput(
            f"the mesh {given.text} has folded or flat cells, or a wrong volume, on the exact surfaces: refine it "
            f"where they are curved"
        )
    return made


def _sizes(mesh: MeshTet1, shape: Shape) -> Sizes:
    """Sizes that tell whether the magnet's fillets have nodes of their own, or are sharp edges in the mesh."""
    sizes = Sizes.of(shape, shape.R / 2, None)
    rho = shape.magnet_edge_radius
    if "magnet" not in mesh.boundaries or not rho:
        return sizes
    on = np.unique(mesh.facets[:, mesh.boundaries["magnet"]])
    r, up = np.hypot(mesh.p[0, on], mesh.p[1, on]), np.abs(mesh.p[2, on] - shape.H)
    sharp = (r > shape.magnet_diameter / 2 - rho / 5) & (up > shape.magnet_height / 2 - rho / 5)
    return replace(sizes, edge=np.inf if sharp.any() else rho)


def _quadratic(mesh: MeshTet1, given: _Cells) -> MeshTet2:
    """The mesh with the middle nodes that it was given."""
    made = MeshTet2.from_mesh(mesh)
    nodes = made.dofs.element_dofs
    number = np.full(made.doflocs.shape[1], -1)
    number[nodes[4:]] = given.cells[:, 4:].T
    if (number[nodes[4:]] != given.cells[:, 4:].T).any():
        raise BadInput(f"cells of the mesh {given.text} have different nodes on a shared edge: merge equal nodes")
    x = made.doflocs.copy()
    x[:, mesh.nvertices :] = given.points[number[mesh.nvertices :]].T
    det = curved_mesh.determinants(x, nodes)
    folded = (det[4:] <= 0).any(axis=0) | ~np.isfinite(det).all(axis=0)
    if folded.any():
        raise BadInput(
            f"{int(folded.sum())} of {folded.size} cells of the mesh {given.text} are inverted or folded: "
            "mesh it again"
        )
    return MeshTet2(x, mesh.t, _boundaries=mesh.boundaries, _subdomains=mesh.subdomains, sort_t=False)
