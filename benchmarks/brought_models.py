"""Models as people bring them: sheets with holes, a tower with windows, doubled cloth, soup, fins, cards, a plate."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from common import ROOT, shapes

from coneflat import read_mesh

Arrays = tuple[np.ndarray, np.ndarray]
#: The folder of small inputs that people brought.
CASES = ROOT.parent / "shared/cases/brought"


def brought_models() -> Iterator[tuple[str, Arrays]]:
    """Yield the names and arrays of all models."""
    for count in (1, 5, 30):
        yield f"sheet-{count}-holes", holed_sheet(count)
    yield "sheet-60-holes-noisy", noisy(holed_sheet(60, 200))
    yield "tower-37-windows", tower()
    yield "cloth-doubled", doubled(shapes.grid(60, 60, drape))
    yield "soup-5000", soup(5_000)
    yield "fins-700", fins(700)
    yield "cards-2000", cards(2_000)
    for path in sorted(CASES.glob("*.obj")):
        source = read_mesh(path)
        yield path.stem, (source.vertices, source.triangles)


def drape(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return heights of a draped cloth."""
    return 0.05 * np.sin(5 * x) + 0.04 * np.cos(4 * x + 3 * y)


def holed_sheet(holes: int, columns: int = 90) -> Arrays:
    """Return a gently curved sheet with round holes at places in rows."""
    vertices, faces = shapes.grid(columns, columns, drape)
    centres = vertices[faces].mean(axis=1)[:, :2]
    rows = int(np.ceil(np.sqrt(holes)))
    row, column = np.divmod(np.arange(holes), rows)
    places = (np.stack([column, row], axis=1) + 0.5) / rows
    distance = np.linalg.norm(centres[:, None] - places, axis=2).min(axis=1)
    return shapes.without(vertices, faces, distance < 0.25 / rows)


def noisy(mesh: Arrays, share: float = 0.2) -> Arrays:
    """Return a mesh with normal noise of a share of its median edge length."""
    vertices, faces = mesh
    sides = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)
    noise = np.random.default_rng(5).standard_normal(vertices.shape)
    return vertices + share * np.median(sides) * noise, faces


def tower() -> Arrays:
    """Return an open square tower with 36 windows and a round hole in its roof."""
    vertices, faces = shapes.box(48, (1.0, 1.0, 2.0))
    vertices, faces = np.asarray(vertices, dtype=float), np.asarray(faces)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    places = (vertices[faces].mean(axis=1) - low) / (high - low)
    normals = np.abs(np.cross(*(vertices[faces][:, i] - vertices[faces][:, 0] for i in (1, 2))))
    side = normals.argmax(axis=1)
    across = np.where(side == 0, places[:, 1], places[:, 0])
    is_floor = (side == 2) & (places[:, 2] < 0.01)
    in_column = np.abs((3 * across) % 1 - 0.5) < 0.2
    in_row = np.abs((3 * places[:, 2]) % 1 - 0.5) < 0.25
    is_window = (side < 2) & in_column & in_row
    is_roof_hole = (side == 2) & (places[:, 2] > 0.99) & (np.hypot(*(places[:, :2] - 0.5).T) < 0.2)
    return shapes.without(vertices, faces, is_floor | is_window | is_roof_hole)


def doubled(mesh: Arrays) -> Arrays:
    """Return a mesh with each triangle a second time in the opposite orientation, on the same vertices."""
    vertices, faces = mesh
    return np.asarray(vertices), np.concatenate([faces, np.asarray(faces)[:, ::-1]])


def soup(count: int) -> Arrays:
    """Return separate triangles of random sizes at random places."""
    random = np.random.default_rng(6)
    places = random.uniform(-10, 10, (count, 1, 3)) + random.standard_normal((count, 3, 3))
    return places.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def fins(count: int) -> Arrays:
    """Return a sphere with a triangle on top of some of its edges, each at the same distance in the list."""
    vertices, faces = shapes.sphere(4, bumps=0.0)
    vertices, faces = np.asarray(vertices), np.asarray(faces)
    sides = np.sort(np.concatenate([faces[:, :2], faces[:, 1:]]), axis=1)
    edges = np.unique(sides, axis=0)
    edges = edges[np.linspace(0, len(edges) - 1, count).astype(np.int64)]
    tips = 1.2 * vertices[edges].mean(axis=1)
    corners = np.column_stack([edges, len(vertices) + np.arange(count)])
    return np.concatenate([vertices, tips]), np.concatenate([faces, corners])


def cards(count: int) -> Arrays:
    """Return leaf cards of two triangles each and different sizes."""
    random = np.random.default_rng(7)
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
    sizes = random.uniform(0.2, 2.0, (count, 1, 3))
    places = 3.0 * np.stack([np.arange(count) % 100, np.arange(count) // 100, np.zeros(count)], axis=1)
    first = 4 * np.arange(count)[:, None, None]
    return (sizes * corners + places[:, None]).reshape(-1, 3), (
        first + np.array([[0, 1, 2], [0, 2, 3]])
    ).reshape(-1, 3)
