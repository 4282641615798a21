"""`coneflat.unwrap` with the interface of the package xatlas; see `coneflat.xatlas`."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base import FloatArray, IntArray, inner_calls, warn_of
from ...errors import ArrayShapeError, FaceIndexError
from ...geometry import fill_nearest
from ...io import atomic_write
from .options import UnwrapOptions
from .soup import UnwrappedSoup, unwrap_soup

#: What xatlas returns for a mesh: (k,) the input vertex of each vertex, (m, 3) faces, and (k, 2) UVs.
Mapped: TypeAlias = tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]


@dataclass
class ChartOptions:
    """The options for charts of xatlas, which have no effect here."""

    max_chart_area: float = 0.0
    max_boundary_length: float = 0.0
    normal_deviation_weight: float = 2.0
    roundness_weight: float = 0.01
    straightness_weight: float = 6.0
    normal_seam_weight: float = 4.0
    texture_seam_weight: float = 0.5
    max_cost: float = 2.0
    max_iterations: int = 1
    use_input_mesh_uvs: bool = False
    fix_winding: bool = False


@dataclass
class PackOptions:
    """The options for packing of xatlas.

    Attributes:
        padding: texels between charts; 0 for the default.
        resolution: texels along a side of the texture; 0 for that of `texels_per_unit`, or else 1024.
        texels_per_unit: texels per unit of length, without a resolution: there is one texture, of one size.
        create_image: make `Atlas.chart_image`. The other options have no effect.
    """

    max_chart_size: int = 0
    padding: int = 0
    texels_per_unit: float = 0.0
    resolution: int = 0
    bilinear: bool = True
    blockAlign: bool = False
    bruteForce: bool = False
    create_image: bool = False
    rotate_charts_to_axis: bool = True
    rotate_charts: bool = True


class Utilization(float):
    """The covered fraction of the only texture; it may also be taken by index, as from a list of one for each."""

    def __getitem__(self, index: int) -> float:
        """Return the covered fraction of a texture."""
        return [float(self)][index]


@dataclass
class Atlas:
    """Meshes that share a square texture.

    Attributes:
        width, height: texels along a side; 0 before `generate`.
        texels_per_unit: texels per unit of length.
        chart_count: number of charts.
        utilization: covered fraction of the texture.
        chart_image: (height, width, 3) colours of the charts.
        notes: what was done to the faces, and unmet guarantees, one sentence each; xatlas has none.
    """

    width: int = 0
    height: int = 0
    texels_per_unit: float = 0.0
    chart_count: int = 0
    utilization: Utilization = field(default_factory=Utilization)
    notes: tuple[str, ...] = ()
    _given: list[tuple[FloatArray, IntArray]] = field(default_factory=list, repr=False)
    _mapped: list[Mapped] = field(default_factory=list, repr=False)
    _image: NDArray[np.uint8] | None = field(default=None, repr=False)

    def add_mesh(
        self,
        positions: ArrayLike,
        indices: ArrayLike,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
    ) -> None:
        """Add a mesh: (n, 3) positions and (m, 3) indices; normals and UVs have no effect.

        Raises:
            ArrayShapeError: arrays have the wrong shape.
            FaceIndexError: an index is not that of a vertex.
        """
        vertices, faces = np.asarray(positions, dtype=np.float64), np.asarray(indices)
        given = {"positions": vertices, "indices": faces, "normals": normals, "uvs": uvs}
        for name, shape in [(name, np.shape(array)) for name, array in given.items() if array is not None]:
            rows, count = len(vertices) if name in ("normals", "uvs") else "n", 2 if name == "uvs" else 3
            if shape[1:] != (count,) or rows not in ("n", shape[0]):
                raise ArrayShapeError(f"{name} must have the shape ({rows}, {count}), not {shape}")
        faces = faces.astype(np.int64)
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise FaceIndexError(f"indices must be from 0 to {len(vertices) - 1:,}")
        self._given.append((vertices, faces))

    def generate(
        self,
        chart_options: ChartOptions | None = None,
        pack_options: PackOptions | None = None,
        verbose: bool = False,
    ) -> None:
        """Compute the UVs of all meshes; unmet guarantees are a `GuaranteeWarning`."""
        self._generate(pack_options)
        warn_of(self.notes, "atlas.notes")

    def _generate(self, pack_options: PackOptions | None = None) -> None:
        pack = PackOptions() if pack_options is None else pack_options
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in self._given)])
        vertices = np.concatenate([np.empty((0, 3)), *(each for each, _ in self._given)])
        every = [faces + start for (_, faces), start in zip(self._given, starts, strict=False)]
        faces = np.concatenate([np.empty((0, 3), dtype=np.int64), *every])
        size = {"resolution": pack.resolution} if pack.resolution else {}
        with inner_calls():
            found = unwrap_soup(
                vertices, faces, **({"padding": pack.padding} if pack.padding else {}), **size
            )
        self.notes = found.notes
        side = pack.resolution or UnwrapOptions().resolution
        if pack.texels_per_unit and not pack.resolution and found.scale:
            side = int(np.ceil(pack.texels_per_unit / found.scale))
        self.width = self.height = side
        self.texels_per_unit, self.utilization = side * found.scale, Utilization(found.efficiency)
        self.chart_count = int(found.chart.max(initial=-1)) + 1
        parts = np.split(found.corner_uv, np.cumsum([len(each) for each in every], dtype=np.int64)[:-1])
        self._mapped = [_mapped(given, part) for (_, given), part in zip(self._given, parts, strict=False)]
        self._image = _image(found, side) if pack.create_image else None

    def get_mesh(self, index: int) -> Mapped:
        """Return a mesh: (k,) the input vertex of each vertex, (m, 3) faces in the given order, and (k, 2) UVs.

        Raises:
            IndexError: there is no such mesh.
        """
        if not 0 <= index < len(self._mapped):
            raise IndexError(f"mesh index {index} is not from 0 to {len(self._mapped) - 1}")
        return self._mapped[index]

    __getitem__ = get_mesh

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self._given)

    mesh_count = property(__len__)

    @property
    def atlas_count(self) -> int:
        """The number of textures."""
        return int(self.width > 0)

    @property
    def chart_image(self) -> NDArray[np.uint8]:
        """(height, width, 3) an image of the charts in different colours, black elsewhere.

        Raises:
            RuntimeError: it was not requested by `PackOptions.create_image`.
        """
        if self._image is None:
            raise RuntimeError("the atlas has no image: set create_image of PackOptions")
        return self._image

    def get_utilization(self, index: int) -> float:
        """Return the covered fraction of a texture."""
        return self.utilization[index]

    def get_chart_image(self, index: int) -> NDArray[np.uint8]:
        """Return the image of a texture, see `chart_image`."""
        return [self.chart_image][index]


def parametrize(
    positions: ArrayLike, indices: ArrayLike, normals: ArrayLike | None = None, uvs: ArrayLike | None = None
) -> Mapped:
    """Return the UVs of a mesh as `Atlas.get_mesh` does; arguments and errors are those of `Atlas.add_mesh`.

    Unmet guarantees are a `GuaranteeWarning`.
    """
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    atlas._generate()
    warn_of(atlas.notes, "`notes` of this warning")
    return atlas[0]


def export(
    path: str | PathLike[str],
    positions: ArrayLike,
    indices: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    normals: ArrayLike | None = None,
) -> None:
    """Write a mesh as OBJ; vertices have the indices of their UVs and normals."""
    arrays = {"v": positions, "vt": uvs, "vn": normals}
    given = {name: np.asarray(array, dtype=np.float64) for name, array in arrays.items() if array is not None}
    faces = np.arange(len(given["v"])).reshape(-1, 3) if indices is None else np.asarray(indices)
    with atomic_write(path, "w") as file:
        for name, array in given.items():
            file.writelines(f"{name} {' '.join(map(repr, row))}\n" for row in array.tolist())
        form = {1: "{0}", 2: "{0}/{0}" if uvs is not None else "{0}//{0}", 3: "{0}/{0}/{0}"}[len(given)]
        file.writelines(f"f {' '.join(form.format(i + 1) for i in row)}\n" for row in faces.tolist())


def _mapped(faces: IntArray, corner_uv: FloatArray) -> Mapped:
    """Return a mesh with one vertex for each pair of an input vertex and a point."""
    uv = corner_uv.reshape(-1, 2).astype(np.float32)
    rows = np.column_stack([faces.ravel(), uv.view(np.int32)])
    _, first, label = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return faces.ravel()[first].astype(np.uint32), label.reshape(faces.shape).astype(np.uint32), uv[first]


def _image(found: UnwrappedSoup, side: int) -> NDArray[np.uint8]:
    """Return (side, side, 3) an image of charts; a texel has the colour of a triangle that contains its centre."""
    face, depth = np.full((side, side), -1), np.full((side, side), np.inf)
    points = np.pad(found.corner_uv.reshape(-1, 2) * side, ((0, 0), (0, 1)))
    fill_nearest(points, np.arange(len(points)).reshape(-1, 3), depth, face)
    colors = np.random.default_rng(0).integers(64, 256, (int(found.chart.max(initial=0)) + 1, 3))
    image, shown = np.zeros((side, side, 3), dtype=np.uint8), face >= 0
    image[shown] = colors[found.chart[face[shown]]]
    return image
