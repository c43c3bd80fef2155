"""Import of a mesh: tetrahedra in any format that meshio reads, checked against the design's exact bodies.

The mesh is in the sensor's frame, mm: base at z = 0, beam along +z. Half a body lies in y >= 0. Linear tetrahedra are
curved to the exact surfaces, as those of `geometry.mesh` are; quadratic ones are not changed.

The regions are named "silicone" and "magnet", in upper or lower case, by physical groups, cell sets or tags, or
numbered 0 and 1 by the cell data `region`, as magtip writes them. Without names and numbers, the cells inside the
magnet form the region "magnet". A mesh without cells inside the magnet has the magnet as a hole.

`by_pytetwild` makes such a mesh by fTetWild (Hu et al., ACM Transactions on Graphics 39, 2020), which has no seed.

The boundaries are found from the positions of the facets. A set of facets named "base", "skin", "symmetry" or
"magnet" must agree with these positions.
"""

import contextlib
import io
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem import MeshTet1, MeshTet2

from geometry import cad, design_digest
from geometry.arrays import Array, Ints
from geometry.bad_input import MeshError
from geometry.design import BadInput, Shape
from geometry.mesh import MagnetCells, tetrahedra
from geometry.meshing import mesh_quality
from geometry.meshing.mesh_quality import determinants, quality

OFF = 5e-3
"""Greatest distance of a node from the surface to which it belongs, in units of D."""
VOLUME = 2e-3
"""Greatest relative error of a region's volume."""
LEVEL = 0.7
"""Least vertical component of a facet's unit normal on base and lids; a facet of a wall has less."""
MOST_BYTES = 500_000_000
"""Largest file of a mesh: ten million quadratic tetrahedra."""
SIDES = ("base", "skin", "symmetry", "magnet")
REGIONS = ("silicone", "magnet")
KINDS = ("tetra", "tetra10")


@dataclass(frozen=True, slots=True)
class _Cells:
    """The tetrahedra of a file.

    Attributes
    ----------
    points : coordinates, shape (n, 3), mm.
    cells : indices of points, shape (m, 4) or (m, 10), corners first, in VTK's order.
    region : index in REGIONS of each cell's region, shape (m,); -1 for a cell without a region.
    sides : corners of the named facets, shape (k, 3), by the name of their side.
    text : name of the file in messages.
    """

    points: Array
    cells: Ints
    region: Ints
    sides: dict[str, Ints]
    text: str


def read(
    path: str | Path, shape: Shape, magnet: MagnetCells = "regions", warn: Callable[[str], None] | None = None
) -> MeshTet2:
    """Read a mesh, mm, with the boundaries and subdomains of `geometry.mesh.tetrahedra`.

    Parameters
    ----------
    magnet : "regions" keeps the cells inside the magnet, "hole" leaves them out, "none" makes all cells silicone.
    warn : function that receives a warning about a file without a label. `magtip mesh` labels its files with the
        sensor for which they were made.

    Raises
    ------
    BadInput
        The file cannot be read or was made for another sensor; its cells are not all linear or all quadratic
        tetrahedra; a cell is inverted (J <= 0); names and positions disagree; or the mesh does not conform, has gaps
        or does not fit the design.
    """
    text = repr(str(path))
    content = _opened(path, text)
    needed = design_digest.of_solid(shape, magnet=magnet != "none")
    numbers = {name: np.ravel(values)[0] for name, values in content.field_data.items() if np.size(values) == 1}
    label = design_digest.from_numbers(numbers)
    if not design_digest.check(label, needed, f"the mesh {text}") and warn is not None:
        warn(
            f"the mesh {text} does not say for which sensor it was made: only its surfaces (to {100 * OFF:g} % of D) "
            f"and volumes (to {100 * VOLUME:g} %) are checked"
        )
    return _on_surfaces(_parsed(content, text), shape, magnet)


def by_pytetwild(shape: Shape, size: float, *, half: bool = True) -> MeshTet2:
    """Mesh the beam with its magnet by pytetwild, in the unit of `shape`; see `geometry.mesh.tetrahedra`.

    size : edge length; pytetwild takes shorter edges where the surfaces need them.

    Raises
    ------
    BadInput
        The size is not positive, or above R/2.
    MeshError
        pytetwild makes no mesh that lies on the surfaces.
    """
    import pytetwild

    # cells with longer edges do not fit the dome, and take minutes
    if not 0 < size <= shape.R / 2:
        raise BadInput(f"size must be a positive length of at most R/2 = {shape.R / 2:g} for pytetwild; got {size:g}")
    magnet: MagnetCells = "regions" if shape.has_magnet else "none"
    # chords of longer edges leave the curved surfaces by more than OFF
    surface = tetrahedra(shape, min(size / 2, shape.D / 16), half=half, magnet=magnet)
    # fTetWild writes a file of its own into the working folder
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        # cells may leave the triangles by 1e-3 of the body's diagonal, which is within OFF
        points, cells = pytetwild.tetrahedralize(
            *_outward(surface), edge_length_abs=size, epsilon=1e-3, num_threads=1
        )
    nowhere = np.full(len(cells), -1)
    source = _Cells(np.asarray(points, np.float64), np.asarray(cells, np.int64), nowhere, {}, "of pytetwild")
    try:
        return _on_surfaces(source, shape, magnet)
    except BadInput as error:
        raise MeshError(
            f"the cells that pytetwild makes with edges of {size:g} do not fit this design: take a smaller size "
            f"({error})"
        ) from error


def _outward(mesh: MeshTet2) -> tuple[Array, Ints]:
    """Return the points, shape (n, 3), and triangles, shape (m, 3), of all boundaries; normals point outward."""
    facets = np.concatenate(list(mesh.boundaries.values()))
    corners, inverted = mesh.facets[:, facets], mesh_quality.senses(mesh, facets) < 0
    corners[:2, inverted] = corners[1::-1, inverted]
    used, index = np.unique(corners, return_inverse=True)
    return np.ascontiguousarray(mesh.p[:, used].T), index.reshape(3, -1).T.astype(np.int32)


def _on_surfaces(cells: _Cells, shape: Shape, magnet: MagnetCells) -> MeshTet2:
    """Return the checked mesh of cells, with its boundaries and subdomains, on the exact surfaces."""
    source = _checked(cells, shape)
    region = _regions(source, shape)
    if magnet == "none":
        shape, region = shape.without_magnet(), np.zeros_like(region)
    elif magnet == "hole":
        source = replace(source, cells=source.cells[region == 0])
        region = region[region == 0]
    straight, corner = _straight(source, region)
    straight = _with_boundaries(straight, source, corner, shape)
    mesh = _linear(straight, source, shape) if source.cells.shape[1] == 4 else _quadratic(straight, source)
    for name, error in quality(mesh, shape)["volume_errors"].items():
        if not abs(error) < VOLUME:
            raise BadInput(
                f"the volume of the {name} in the mesh {source.text} is wrong by {100 * error:.3g} % (at most "
                f"{100 * VOLUME:g} % is allowed): mesh this design, without gaps or overlaps"
            )
    return mesh


def _opened(path: str | Path, text: str) -> Any:
    import meshio

    if Path(path).is_dir():
        raise BadInput(f"{text} is a folder: give the file of a mesh")
    if not Path(path).exists():
        raise BadInput(f"there is no file {text}: check its path")
    if not Path(path).is_file():
        raise BadInput(f"{text} is a device or a pipe: give the file of a mesh")
    if Path(path).stat().st_size > MOST_BYTES:
        raise BadInput(f"the mesh {text} has more than {MOST_BYTES // 1_000_000} MB: make a coarser one")
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        # meshio's readers raise many kinds of errors on a damaged file, and some of them exit
        reason = "damaged or truncated" if isinstance(error, SystemExit) else str(error) or type(error).__name__
        raise BadInput(f"meshio cannot read the mesh {text} ({reason}): save it in another format") from None


def _parsed(content: Any, text: str) -> _Cells:
    foreign = set(content.cells_dict) - {*KINDS, "vertex", "line", "line3", "triangle", "triangle6"}
    kinds = [kind for kind in KINDS if kind in content.cells_dict]
    if foreign or len(kinds) != 1:
        present = ", ".join(sorted(content.cells_dict)) or "no cells"
        raise BadInput(f"the mesh {text} must consist of tetrahedra, all linear or all quadratic; got {present}")
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
    """Return the indices of named cells: first by name in lower case, then by kind of cell.

    Names come from cell sets, from Gmsh's physical groups and from MED's tags. Cell sets take precedence.
    """
    indices: dict[str, dict[str, Ints]] = {}
    for name, by_kind in content.cell_sets_dict.items():
        indices.setdefault(name.lower(), {}).update(by_kind)
    tags: list[tuple[str, int, str]] = [
        (name, int(tag[0]), "gmsh:physical") for name, tag in content.field_data.items()
    ]
    tags += [(name, tag, "cell_tags") for tag, names in getattr(content, "cell_tags", {}).items() for name in names]
    for name, tag, data in tags:
        for kind, numbers in content.cell_data_dict.get(data, {}).items():
            indices.setdefault(name.strip().lower(), {}).setdefault(kind, np.flatnonzero(np.asarray(numbers) == tag))
    return indices


def _checked(source: _Cells, shape: Shape) -> _Cells:
    """Check indices, coordinates, height and volumes; return the cells with all corner orders positive."""
    points, cells, text = source.points, source.cells, source.text
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
    # some programs write all cells with the opposite order: exchange corners 1 and 2, and the middle nodes with them
    mirrored = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8][: cells.shape[1]]
    return replace(source, cells=np.where((six < 0)[:, None], cells[:, mirrored], cells))


def _regions(source: _Cells, shape: Shape) -> Ints:
    """Return the index in REGIONS of each cell's region, from its name or else from its position."""
    centres = source.points[source.cells[:, :4]].mean(axis=1).T
    depth = mesh_quality.magnet(centres, shape)[0] if shape.has_magnet else np.ones(len(source.cells))
    place = (depth < 0).astype(np.int64)
    if (source.region < 0).all():
        return place
    if (source.region < 0).any():
        count = int((source.region < 0).sum())
        raise BadInput(
            f"{count} of {len(place)} cells of the mesh {source.text} belong to neither of the regions silicone and "
            f"magnet: assign a region to every cell, or to none"
        )
    wrong = (place != source.region) & (np.abs(depth) > OFF * shape.D)
    if wrong.any():
        raise BadInput(
            f"{int(wrong.sum())} of {len(place)} cells of the mesh {source.text} are assigned to the wrong region: "
            f"check the names of the regions, and that this is a mesh of this design"
        )
    return source.region


def _straight(source: _Cells, region: Ints) -> tuple[MeshTet1, Ints]:
    """Return the linear mesh with its regions, and the index of each point among its vertices (-1: none)."""
    used, t = np.unique(source.cells[:, :4], return_inverse=True)
    corner = np.full(len(source.points), -1)
    corner[used] = np.arange(len(used))
    regions = {name: np.flatnonzero(region == k) for k, name in enumerate(REGIONS) if (region == k).any()}
    p, t = np.ascontiguousarray(source.points[used].T), np.ascontiguousarray(t.reshape(-1, 4).T)
    mesh = MeshTet1(p, t, sort_t=False).with_subdomains(regions)
    if np.bincount(mesh.t2f.ravel()).max() > 2:
        raise BadInput(f"the cells of the mesh {source.text} overlap: more than two share a facet")
    return mesh, corner


def _with_boundaries(mesh: MeshTet1, source: _Cells, corner: Ints, shape: Shape) -> MeshTet1:
    """Add the boundaries, found from the positions of the facets, and compare them with the named facets."""
    near = OFF * shape.D
    half = bool(mesh.p[1].min() > -near)
    sides = _flat_sides(mesh, near, half)
    rest = sides["skin"]

    def on(surface: Callable[[Array, Shape], tuple[Array, Array]], body: Shape) -> NDArray[np.bool_]:
        return np.asarray((np.abs(surface(mesh.p, body)[0]) < near)[mesh.facets[:, rest]].all(axis=0))

    skin, hole = on(mesh_quality.skin, shape), np.zeros(len(rest), dtype=bool)
    if shape.has_magnet:
        # linear cells may represent a small fillet of the magnet by a sharp edge
        hole = (
            on(mesh_quality.magnet, shape) | on(mesh_quality.magnet, replace(shape, magnet_edge_radius=0.0))
        ) & ~skin
    lost = rest[~skin & ~hole]
    if len(lost) or (hole.any() and "magnet" in mesh.subdomains):
        where = mesh.p[:, mesh.facets[:, (lost if len(lost) else rest[hole])[0]]].mean(axis=1)
        raise BadInput(
            f"the mesh {source.text} has an outer facet at ({where[0]:.4g}, {where[1]:.4g}, {where[2]:.4g}) mm that "
            f"lies on no outer surface of this design (within {near:.3g} mm): merge equal nodes, so that it "
            "conforms, or mesh this design"
        )
    sides |= {"skin": rest[skin]}
    if hole.any():
        sides["magnet"] = rest[hole]
    for name, facets in source.sides.items():
        _check_names(name, mesh, sides.get(name, rest[:0]), corner[facets], source.text)
    return mesh.with_boundaries(sides)


def _flat_sides(mesh: MeshTet1, tolerance: float, half: bool) -> dict[str, Ints]:
    """Return the facets of base, of the plane of symmetry and of the magnet's interface, and all others as "skin".

    tolerance : largest distance of a facet from the plane of base or symmetry. half : True for the part y >= 0.
    """
    first, second = mesh.f2t
    outer = np.flatnonzero(second < 0)
    normal = _normals(mesh, outer)
    flat = [(np.abs(mesh.p[k, mesh.facets[:, outer]]).max(axis=0) < tolerance) & (normal[k] > LEVEL) for k in (1, 2)]
    base, mirror = flat[1], flat[0] & ~flat[1] & half
    sides = {"base": outer[base], "skin": outer[~base & ~mirror]}
    if half:
        sides["symmetry"] = outer[mirror]
    if "magnet" in mesh.subdomains:
        inside = np.isin(np.arange(mesh.nelements), mesh.subdomains["magnet"])
        sides["magnet"] = np.flatnonzero((second >= 0) & (inside[first] != inside[second]))
    return sides


def _normals(mesh: MeshTet1, facets: Ints) -> Array:
    """Return the magnitudes of the components of the unit normals of facets, shape (3, n)."""
    a, b, c = np.moveaxis(mesh.p[:, mesh.facets[:, facets]], 1, 0)
    normal = np.abs(np.cross(b - a, c - a, axis=0))
    return np.asarray(normal / np.linalg.norm(normal, axis=0))


def _check_names(name: str, mesh: MeshTet1, located: Ints, named: Ints, text: str) -> None:
    """Raise BadInput if the facets with a name are not those that lie on the surface of this name.

    located : indices of the facets on the surface, shape (n,). named : corners of the named facets, shape (m, 3).
    """
    places = {tuple(sorted(facet)) for facet in mesh.facets[:, located].T.tolist()}
    names = {tuple(sorted(facet)) for facet in named.tolist()}
    if places != names:
        raise BadInput(
            f"the mesh {text} lists {len(names)} facets as {name}, but {len(places)} facets lie on that surface "
            f"({len(places & names)} are in both): correct that set, or leave it out"
        )


def _linear(mesh: MeshTet1, source: _Cells, shape: Shape) -> MeshTet2:
    """Return the second-order mesh on the exact surfaces.

    Vertices and middle nodes of the boundaries are moved to the closest points of the exact surfaces. Where that
    distorts a cell, its middle nodes are moved back, in steps, towards straight edges.
    """
    dofs = MeshTet2.from_mesh(mesh).dofs
    on = {name: dofs.get_facet_dofs(facets).all() for name, facets in mesh.boundaries.items()}
    if "magnet" in on and _is_sharp(mesh, shape):
        shape = _sharpened(shape)
        facets = mesh.boundaries["magnet"]
        lid = _normals(mesh, facets)[2] > LEVEL
        on["edge"] = np.intersect1d(*(dofs.get_facet_dofs(facets[side]).all() for side in (lid, ~lid)))
    vertices = {name: nodes[nodes < mesh.nvertices] for name, nodes in on.items()}
    straight = MeshTet2.from_mesh(replace(mesh, doflocs=_projected(mesh.p, vertices, shape)))
    straight = straight.with_boundaries(mesh.boundaries).with_subdomains(mesh.subdomains)
    bend = _projected(straight.doflocs, on, shape) - straight.doflocs
    middles, share = straight.dofs.element_dofs[4:], np.ones(bend.shape[1])
    # 0.75^20 of the way to the curved surface is none
    for _ in range(20):
        curved = replace(straight, doflocs=straight.doflocs + share * bend)
        det = determinants(curved)
        # in a cell that is nearly folded strains are wrong by orders of magnitude
        bad = (det <= 0).any(axis=0) | (det[4:].min(axis=0) < 0.05 * det[4:].max(axis=0))
        if not bad.any():
            return mesh_quality.with_exact_volumes(curved, shape)
        share[middles[:, bad]] *= 0.75
    raise BadInput(
        f"the mesh {source.text} has folded or flat cells, or a wrong volume, on the exact surfaces: refine it "
        f"where they are curved"
    )


def _projected(x: Array, on: dict[str, Ints], shape: Shape) -> Array:
    """Return points, shape (3, n), moved to the exact surfaces on which they lie.

    on : indices of the points on each boundary, and on the magnet's sharp "edge".
    """
    x = x.copy()
    # lines last: points of a sharp edge then lie on it exactly
    x[1, on.get("symmetry", [])] = 0
    x[2, on["base"]] = 0
    for name, surface in (("skin", mesh_quality.skin), ("magnet", mesh_quality.magnet)):
        nodes = on.get(name, on["base"][:0])
        distance, normal = surface(x[:, nodes], shape)
        x[:, nodes] -= distance * normal
    edge = on.get("edge", on["base"][:0])
    x[:2, edge] *= shape.magnet_diameter / 2 / np.hypot(*x[:2, edge])
    x[2, edge] = shape.H + np.sign(x[2, edge] - shape.H) * shape.magnet_height / 2
    return x


def _is_sharp(mesh: MeshTet1, shape: Shape) -> bool:
    """Return True if the mesh represents the magnet's fillets by sharp edges."""
    rho = shape.magnet_edge_radius
    on = np.unique(mesh.facets[:, mesh.boundaries["magnet"]])
    r, up = np.hypot(mesh.p[0, on], mesh.p[1, on]), np.abs(mesh.p[2, on] - shape.H)
    corner = (r > shape.magnet_diameter / 2 - rho / 5) & (up > shape.magnet_height / 2 - rho / 5)
    return not rho or bool(corner.any())


def _sharpened(shape: Shape) -> Shape:
    """Return the shape with a sharp magnet of the same volume, smaller on all sides by one distance."""
    sharp = replace(shape, magnet_edge_radius=0.0)
    a, b = shape.magnet_diameter / 2, shape.magnet_height / 2
    inset = (cad.magnet_volume(sharp) - cad.magnet_volume(shape)) / (2 * math.pi * a * (a + 2 * b))
    return replace(sharp, magnet_diameter=2 * (a - inset), magnet_height=2 * (b - inset))


def _quadratic(mesh: MeshTet1, source: _Cells) -> MeshTet2:
    straight = MeshTet2.from_mesh(mesh)
    nodes = straight.dofs.element_dofs
    number = np.full(straight.doflocs.shape[1], -1)
    # cells that share an edge must share its middle node: `number` keeps the last one, which then differs from others
    number[nodes[4:]] = source.cells[:, 4:].T
    if (number[nodes[4:]] != source.cells[:, 4:].T).any():
        raise BadInput(f"cells of the mesh {source.text} have different nodes on a shared edge: merge equal nodes")
    x = straight.doflocs.copy()
    x[:, mesh.nvertices :] = source.points[number[mesh.nvertices :]].T
    curved = MeshTet2(x, mesh.t, sort_t=False).with_boundaries(mesh.boundaries).with_subdomains(mesh.subdomains)
    det = determinants(curved)
    folded = (det[4:] <= 0).any(axis=0) | ~np.isfinite(det).all(axis=0)
    if folded.any():
        raise BadInput(
            f"{int(folded.sum())} of {folded.size} cells of the mesh {source.text} are inverted or folded: "
            "mesh it again"
        )
    return curved
