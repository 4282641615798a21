"""Patterns, measured from the files that are written: `python benchmarks/patterns.py` prints two Markdown tables.

Cloth: models, 300 mm high, for several bounds of the strain. The strain is that of the edges of the model's triangles.
On seams, where the file has their ends, it is measured from the DXF file by a reader that shares no code with the
writer. In the interior of the pieces a file has no points: there the pattern's own are taken. The last column is the
seam length of the texture `coneflat.unwrap` with the same mean strain, by bisection of `max_energy`.

Nets: polyhedra and decimated models, 200 mm high. The distortion is the largest strain, of the
pattern and from the DXF file; overlaps are those of the outlines with tabs. Seconds are CPU time.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from common import model, polyhedra, shapes
from drawn import DrawnLine, dxf_lines, overlapping, points_of_file, triangle_strains

from coneflat import GuaranteeWarning, TriangleMesh, check_mesh, pattern, unwrap
from coneflat.apps.patterns import Pattern
from coneflat.apps.patterns.net.tabs import glue_tabs

Arrays = tuple[np.ndarray, np.ndarray]

#: Heights of cloth and of nets, mm.
CLOTH_HEIGHT, NET_HEIGHT = 300.0, 200.0
#: The energy of an isometry; energies above it between which textures are searched, and number of bisections.
ISOMETRIC, ENERGIES, BISECTIONS = 4.0, (1e-5, 1.0), 7

CLOTH_MADE = ("sphere", "torus", "vase")
CLOTH_MODELS = ("spot", "rocker-arm", "fandisk", "hand", "kitten", "stanford-bunny", "knight")
NET_MODELS = (
    "spot", "bunny", "hand", "horse", "kitten", "rocker-arm", "fandisk", "elephant", "camelhead", "3holes"
)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", default="cloth,nets", help="with commas")
    parser.add_argument("--models", default=",".join((*CLOTH_MADE, *CLOTH_MODELS)), help="of cloth")
    parser.add_argument("--net-models", default=",".join(NET_MODELS), help="decimated ones")
    parser.add_argument("--strains", default="10,5,3,1", help="percent")
    parser.add_argument("--triangles", type=int, default=1500, help="models of cloth are decimated to")
    parser.add_argument("--net-triangles", type=int, default=1500, help="models of nets are decimated to")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", GuaranteeWarning)  # The tables say what is not met.
    pattern(*shapes.sphere(2), height=100.0)  # This compiles or loads the kernels.
    if "cloth" in arguments.tables:
        strains = [float(word) for word in arguments.strains.split(",")]
        print_cloth(arguments.models.split(","), strains, arguments.triangles)
    if "nets" in arguments.tables:
        print_nets(arguments.net_models.split(","), arguments.net_triangles)


def print_cloth(names: Sequence[str], strains: Sequence[float], triangles: int) -> None:
    print_header(
        "model|triangles|strain, %|pieces|darts|seams / diagonal|largest strain from the file, %|on seams, %|mean, %"
        "|from the model, mm|CPU s|seams / diagonal of unwrap at this mean"
    )
    for name in names:
        mesh = cloth_model(name, triangles)
        for strain in strains:
            print(f"| {name} | {' | '.join(cloth_cells(mesh, strain))} |", flush=True)


def print_nets(names: Sequence[str], triangles: int) -> None:
    print_header("model|triangles|pieces|distortion|from the file|overlaps|tabs|without room|CPU s")
    for name, mesh in net_models(names, triangles):
        print(f"| {name} | {' | '.join(net_cells(mesh))} |", flush=True)


def print_header(columns: str) -> None:
    print(f"\n| {' | '.join(columns.split('|'))} |\n{'| --- ' * (columns.count('|') + 1)}|", flush=True)


def cloth_model(name: str, triangles: int) -> Arrays:
    """Return a shape that is made, or a model with at most a number of triangles."""
    match name:
        case "sphere":
            return arrays(polyhedra.icosphere(3))
        case "torus":
            return shapes.torus()
        case "vase":
            heights = np.linspace(0.0, 3.0, 25)
            return arrays(polyhedra.turned(1.0 + 0.4 * np.sin(2 * heights), heights, 40))
        case _:
            return decimated(*model(name, 0), triangles)


def net_models(names: Sequence[str], triangles: int) -> Iterator[tuple[str, Arrays]]:
    """Yield polyhedra, and decimated models."""
    for name in ("tetrahedron", "cube", "octahedron", "dodecahedron", "icosahedron"):
        yield name, arrays(getattr(polyhedra, name)())
    yield "prism of 7 sides", arrays(polyhedra.prism(7))
    yield "box on a box", arrays(polyhedra.box_on_box())
    yield "sphere of 320", arrays(polyhedra.icosphere(2))
    for name in filter(None, names):
        yield name, decimated(*model(name, 0), triangles)


def arrays(mesh: TriangleMesh) -> Arrays:
    return mesh.vertices, mesh.faces


def decimated(vertices: np.ndarray, faces: np.ndarray, triangles: int) -> Arrays:
    """Return a mesh with at most a number of triangles, and its upward axis unchanged."""
    if len(faces) <= triangles:
        return vertices, faces
    import fast_simplification

    small = fast_simplification.simplify(vertices, faces, 1 - triangles / len(faces))
    return arrays(check_mesh(*small, repair=True).mesh)


def cloth_cells(mesh: Arrays, percent: float) -> list[str]:
    """Return the cells of a model and a bound of the strain."""
    start = time.process_time()
    result = pattern(*mesh, height=CLOTH_HEIGHT, strain=percent / 100)
    seconds = time.process_time() - start
    strains, is_drawn = file_strains(result)
    surface, diagonal = result.surface, diagonal_of(result)
    mean, amounts = mean_strain(strains, surface.mesh), np.abs(strains)
    on_seams = amounts[is_drawn].max() if is_drawn.any() else 0.0
    return [
        f"{len(surface.mesh.faces):,}",
        f"{percent:g}",
        f"{result.piece_count}",
        f"{len(result.darts)}",
        f"{surface.seam_length / diagonal:.2f}",
        f"{100 * amounts.max():.3g}",
        f"{100 * on_seams:.3g}",
        f"{100 * mean:.2f}",
        f"{distance_from(mesh, result):.2f}",
        f"{seconds:.0f}",
        texture_cell(surface.mesh, mean, diagonal),
    ]


def net_cells(mesh: Arrays) -> list[str]:
    """Return the cells of a net."""
    start = time.process_time()
    result = pattern(*mesh, height=NET_HEIGHT, kind="net")
    seconds = time.process_time() - start
    strains, _ = file_strains(result)
    tabs = glue_tabs(result.surface, result.borders, result.settings["tabs"])
    return [
        f"{len(result.surface.mesh.faces):,}",
        f"{result.piece_count}",
        f"{np.abs(result.strains).max():.0e}",
        f"{np.abs(strains).max():.0e}",
        f"{overlapping(lines_of_file(result))}",
        f"{len(tabs.tabs)}",
        f"{len(tabs.lengths_without)}",
        f"{seconds:.1f}",
    ]


def lines_of_file(result: Pattern) -> list[DrawnLine]:
    """Return the lines of a pattern's DXF file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pattern.dxf"
        result.save(path)
        return dxf_lines(path)


def file_strains(result: Pattern) -> tuple[np.ndarray, np.ndarray]:
    """Return (m, 3) the strains of the sides of the triangles, and which have both ends in the file."""
    surface = result.surface
    vertices, faces, corners = surface.mesh.vertices, surface.mesh.faces, surface.corners
    is_border = np.zeros(len(surface.points), dtype=bool)
    is_border[corners[surface.is_border_vertex[faces]]] = True
    points, is_drawn = points_of_file(surface.points, lines_of_file(result), is_border)
    ends = is_drawn[corners]
    return triangle_strains(vertices, faces, points, corners), ends[:, [1, 2, 0]] & ends[:, [2, 0, 1]]


def mean_strain(strains: np.ndarray, mesh: TriangleMesh) -> float:
    """Return the mean of the amounts of strains (m, 3), weighted by length; sides inside pieces count twice."""
    corners = mesh.vertices[mesh.faces]
    lengths = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
    return float(np.average(np.abs(strains), weights=lengths))


def diagonal_of(result: Pattern) -> float:
    return float(np.linalg.norm(np.ptp(result.surface.mesh.vertices, axis=0)))


def distance_from(mesh: Arrays, result: Pattern) -> float:
    """Return the largest distance of the pattern's vertices from the model, mm."""
    from coneflat.geometry import surface_distances

    checked = check_mesh(*mesh).mesh
    vertices = (checked.vertices - checked.vertices.mean(axis=0)) * result.millimetres
    return float(surface_distances(vertices, checked.faces, result.surface.mesh.vertices).max())


def texture_cell(mesh: TriangleMesh, mean: float, diagonal: float) -> str:
    """Return the seam length of the texture with the largest mean strain up to the given one."""
    low, high = np.log(ENERGIES)
    lengths = []
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        texture = unwrap(mesh.vertices, mesh.faces, max_energy=ISOMETRIC + np.exp(middle), packing_cuts=0.0)
        strains = triangle_strains(
            texture.vertices, texture.faces, texture.uv / texture.uv_scale, texture.uv_faces
        )
        if mean_strain(strains, mesh) <= mean:
            low = middle
            lengths.append(seam_length(texture.vertices, texture.seams))
        else:
            high = middle
    return f"{min(lengths) / diagonal:.2f}" if lengths else "none"


def seam_length(vertices: np.ndarray, seams: np.ndarray) -> float:
    return float(np.linalg.norm(vertices[seams[:, 1]] - vertices[seams[:, 0]], axis=1).sum())


if __name__ == "__main__":
    main()
