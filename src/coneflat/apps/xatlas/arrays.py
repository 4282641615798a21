"""What `coneflat.xatlas` computes: arrays of users, UVs of several meshes in textures, images, and OBJ files.

These need NumPy and much more, so they are imported when they are called.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from os import PathLike
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base import FloatArray, IntArray, as_floats, as_indices
from ...errors import ArrayShapeError, FaceIndexError, NonFiniteError, OptionError, TooLargeError
from ...geometry import fill_nearest, signed_double_areas
from ...io import atomic_write
from ...textures import UnwrappedSoup, unwrap_soup
from .options import PackOptions

#: What xatlas returns for a mesh: (k,) the input vertex of each vertex, (m, 3) faces, and (k, 2) UVs.
Mapped: TypeAlias = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]

# Texels of an image that are computed at once: these take 16 MB.
TEXELS_PER_BAND = 2**20
# Texels along a side of an image, at most: it takes 805 MB.
MAX_IMAGE_SIDE = 2**14
# Texels along a side of the blocks of compressed textures.
BLOCK_SIZE = 4


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """A mesh that was added: (n, 3) positions and (m, 3) faces."""

    vertices: FloatArray
    faces: IntArray


@dataclass(frozen=True, eq=False)
class Texture:
    """Meshes that share square textures.

    Attributes:
        soup: the UVs of all faces.
        meshes: what is returned for each mesh.
        first_faces: the first face of each mesh, and the number of all faces.
        side: texels along a side.
    """

    soup: UnwrappedSoup
    meshes: tuple[Mapped, ...]
    first_faces: IntArray
    side: int

    @property
    def chart_count(self) -> int:
        """Number of charts."""
        return int(self.soup.chart.max(initial=-1)) + 1

    @cached_property
    def coverage(self) -> FloatArray:
        """(t,) the covered fraction of each texture, of which there is at least one."""
        texture = self.soup.texture
        areas = np.abs(signed_double_areas(self.soup.corner_uv)) / 2
        return np.bincount(texture[texture >= 0], areas[texture >= 0], minlength=1).astype(np.float64)

    def of_vertices(self, index: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Return the texture and the chart of each vertex of a mesh, 2^32 - 1 for those of faces without area."""
        vertices, corners, _ = self.meshes[index]
        faces = slice(*self.first_faces[index : index + 2])
        owners = []
        for of_face in (self.soup.texture[faces], self.soup.chart[faces]):
            owner = np.full(len(vertices), -1)
            owner[corners] = of_face[:, None]
            owners.append(owner.astype(np.uint32))
        return owners[0], owners[1]

    def charts_of(self, index: int) -> tuple[IntArray, IntArray]:
        """Return the charts of a mesh, ascending, and (m,) the one of each face among them, -1 for none."""
        chart = self.soup.chart[slice(*self.first_faces[index : index + 2])]
        charts = np.unique(chart[chart >= 0])
        return charts, np.where(chart >= 0, np.searchsorted(charts, chart), -1)


def read_arrays(
    positions: ArrayLike, indices: ArrayLike, normals: ArrayLike | None, uvs: ArrayLike | None
) -> MeshArrays:
    """Return the arrays of a mesh, checked; see `coneflat.xatlas.Atlas.add_mesh`."""
    vertices = as_rows("positions", positions, 3)
    for name, values, width in (("normals", normals, 3), ("uvs", uvs, 2)):
        if values is not None:
            as_rows(name, values, width, len(vertices))
    return MeshArrays(vertices, _read_faces(indices, len(vertices)))


def as_rows(name: str, values: ArrayLike, width: int, count: int | None = None) -> FloatArray:
    """Return an array (n, width) of numbers; with a `count`, n must be that.

    Raises:
        ArrayShapeError: the values have another shape or type.
    """
    rows = as_floats(name, values)
    if rows.ndim != 2 or rows.shape[1] != width or count not in (None, len(rows)):
        expected = "n" if count is None else count
        raise ArrayShapeError(f"{name} must have the shape ({expected}, {width}), not {rows.shape}")
    return rows


def _read_faces(indices: ArrayLike, count: int) -> IntArray:
    """Return (m, 3) indices of `count` vertices; m may be 0."""
    faces = as_indices("indices", indices)
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ArrayShapeError(f"indices must have the shape (n, 3), not {faces.shape}")
    if len(faces) and not 0 <= faces.min() <= faces.max() < count:
        raise FaceIndexError(
            f"indices must be from 0 to {count - 1:,}, and they are from {faces.min():,} to {faces.max():,}"
        )
    return faces


def unwrap_meshes(meshes: list[MeshArrays], pack: PackOptions, search_time: float | None = None) -> Texture:
    """Return the UVs of all meshes in one texture.

    Args:
        meshes: the meshes.
        pack: the options for packing.
        search_time: see `coneflat.unwrap`.

    Raises:
        OptionError: an option for packing is invalid or leaves no space for charts, or the search time is invalid.
    """
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([np.empty((0, 3)), *(mesh.vertices for mesh in meshes)])
    shifted = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    faces = np.concatenate([np.empty((0, 3), dtype=np.int64), *shifted])
    # With a resolution, there are as many textures as the density needs.
    density = "density" if pack.resolution else "texel_density"
    chosen = {"padding": pack.padding, "resolution": pack.resolution, density: pack.texels_per_unit}
    chosen |= {"block_size": BLOCK_SIZE} if pack.blockAlign else {}
    try:
        options = {name: value for name, value in chosen.items() if value}
        soup = unwrap_soup(vertices, faces, **options, search_time=search_time)
    except OptionError as error:
        raise OptionError(str(error).replace("texel_density", "texels_per_unit")) from None
    first_faces = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    mapped = [
        _mapped(mesh.faces, soup.corner_uv[first:end], soup.chart[first:end])
        for mesh, (first, end) in zip(meshes, pairwise(first_faces), strict=True)
    ]
    return Texture(soup, tuple(mapped), first_faces, soup.resolution)


def _mapped(faces: IntArray, corner_uv: FloatArray, chart: IntArray) -> Mapped:
    """Return a mesh with one vertex for each input vertex, point and chart."""
    uv = corner_uv.reshape(-1, 2).astype(np.float32)
    rows = np.column_stack([faces.ravel(), uv.view(np.int32), chart.repeat(3)])
    _, first, label = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return faces.ravel()[first].astype(np.uint32), label.reshape(faces.shape).astype(np.uint32), uv[first]


def draw_charts(texture: Texture, index: int = 0) -> NDArray[np.uint8]:
    """Return (side, side, 3) an image of a texture; a texel has the colour of a triangle that contains its centre.

    Raises:
        TooLargeError: the image would have more than `MAX_IMAGE_SIDE` texels along a side.
    """
    soup, side = texture.soup, texture.side
    if side > MAX_IMAGE_SIDE:
        raise TooLargeError(
            f"an image of {side:,} texels along a side takes {3 * side**2 / 1e9:.1f} GB: images are drawn up to "
            f"{MAX_IMAGE_SIDE:,} texels"
        )
    charts = soup.chart[soup.texture == index]
    points = np.pad(soup.corner_uv[soup.texture == index].reshape(-1, 2) * side, ((0, 0), (0, 1)))
    corners = np.arange(len(points)).reshape(-1, 3)
    random = np.random.default_rng(0)
    colors = random.integers(64, 256, (max(texture.chart_count, 1), 3)).astype(np.uint8)
    image, rows = np.zeros((side, side, 3), dtype=np.uint8), max(TEXELS_PER_BAND // side, 1)
    for start in range(0, side, rows):
        band = image[start : start + rows]
        face, depth = np.full(band.shape[:2], -1), np.full(band.shape[:2], np.inf)
        fill_nearest(points - [0, start, 0], corners, depth, face)
        is_covered = face >= 0
        band[is_covered] = colors[charts[face[is_covered]]]
    return image


def write_obj(
    path: str | PathLike[str],
    positions: ArrayLike,
    indices: ArrayLike | None,
    uvs: ArrayLike | None,
    normals: ArrayLike | None,
) -> None:
    """Write a mesh as OBJ; see `coneflat.xatlas.export`."""
    vertices = as_rows("positions", positions, 3)
    arrays = {"v": vertices}
    for keyword, name, values, width in (("vt", "uvs", uvs, 2), ("vn", "normals", normals, 3)):
        if values is not None:
            arrays[keyword] = as_rows(name, values, width, len(vertices))
    for keyword, rows in arrays.items():
        if not np.isfinite(rows).all():
            name = {"v": "positions", "vt": "uvs", "vn": "normals"}[keyword]
            raise NonFiniteError(f"{name} must be finite, but some are NaN or infinite: no file was written")
    if indices is None and len(vertices) % 3:
        raise ArrayShapeError(f"positions without indices must be three for each face, not {len(vertices):,}")
    corners = np.arange(len(vertices)).reshape(-1, 3) if indices is None else indices
    faces = _read_faces(corners, len(vertices)) + 1
    form = "/".join(["{0}", "{0}" if "vt" in arrays else "", "{0}" if "vn" in arrays else ""]).rstrip("/")
    with atomic_write(path, "w") as file:
        for keyword, rows in arrays.items():
            file.writelines(f"{keyword} {' '.join(map(repr, row))}\n" for row in rows.tolist())
        file.writelines(f"f {' '.join(map(form.format, row))}\n" for row in faces.tolist())
