"""`coneflat.unwrap` with the interface of the package xatlas; see `coneflat.xatlas`.

What needs more than Python is in `arrays.py`, so that `import coneflat.xatlas` is fast.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from operator import index as as_index
from os import PathLike
from typing import TYPE_CHECKING

from ...base import inner_calls, warn_of, warns
from .options import ChartOptions, PackOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from .arrays import Mapped, MeshArrays, Texture


class Utilization(float):
    """The covered fraction of the first texture; that of each may be taken by index, as from a list."""

    _fractions: tuple[float, ...] = ()

    @classmethod
    def of_textures(cls, fractions: Iterable[float]) -> Utilization:
        """Return the covered fractions of textures, of which there is at least one."""
        values = tuple(fractions)
        utilization = cls(values[0])
        utilization._fractions = values
        return utilization

    def __getitem__(self, index: int) -> float:
        """Return the covered fraction of a texture."""
        return self._fractions[index]


@dataclass(frozen=True, eq=False)
class Chart:
    """A chart of a mesh.

    Attributes:
        faces: (k,) its faces.
        atlas_index: its texture.
        material: 0, as meshes have one material.
    """

    faces: NDArray[np.uint32]
    atlas_index: int
    material: int = 0


@dataclass(eq=False)
class Atlas:
    """Meshes that share square textures.

    Attributes:
        width, height: texels along a side; 0 before `generate`.
        texels_per_unit: texels per unit of length.
        chart_count: number of charts.
        atlas_count: number of textures.
        utilization: covered fraction of each texture, by its index; as a number that of the first one.
        chart_image: (height, width, 3) colours of the charts of the first texture.
        notes: what was done to the faces, and unmet guarantees, one sentence each; xatlas has none.
    """

    width: int = 0
    height: int = 0
    texels_per_unit: float = 0.0
    chart_count: int = 0
    utilization: Utilization = field(default_factory=Utilization)
    notes: tuple[str, ...] = ()
    _added: list[MeshArrays] = field(default_factory=list, repr=False)
    _texture: Texture | None = field(default=None, repr=False)
    _has_images: bool = field(default=False, repr=False)
    _image: tuple[int, NDArray[np.uint8]] | None = field(default=None, repr=False)

    def add_mesh(
        self,
        positions: ArrayLike,
        indices: ArrayLike,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
    ) -> None:
        """Add a mesh: (n, 3) positions and (m, 3) indices; normals and UVs have no effect.

        Raises:
            ArrayShapeError: arrays have the wrong shape or type.
            FaceIndexError: an index is not that of a vertex.
        """
        from .arrays import read_arrays

        self._added.append(read_arrays(positions, indices, normals, uvs))

    @warns("atlas.notes", notes=lambda _, atlas, *options: atlas.notes)
    def generate(
        self,
        chart_options: ChartOptions | None = None,
        pack_options: PackOptions | None = None,
        verbose: bool = False,
    ) -> None:
        """Compute the UVs of all meshes; unmet guarantees are a `GuaranteeWarning`.

        Raises:
            OptionError: an option for packing is invalid or leaves no space for charts, or the search time is invalid.
        """
        from .arrays import unwrap_meshes

        pack = PackOptions() if pack_options is None else pack_options
        chart = ChartOptions() if chart_options is None else chart_options
        texture = unwrap_meshes(self._added, pack, chart.search_time)
        self.notes = texture.soup.notes
        self.width = self.height = texture.side
        self.texels_per_unit = texture.side * texture.soup.scale
        self.utilization = Utilization.of_textures(texture.coverage.tolist())
        self.chart_count = texture.chart_count
        self._texture, self._has_images, self._image = texture, pack.create_image, None

    def get_mesh(self, index: int) -> Mapped:
        """Return a mesh: (k,) the input vertex of each vertex, (m, 3) faces in the given order, and (k, 2) UVs.

        Raises:
            IndexError: there is no such mesh.
        """
        return self._texture_of(index).meshes[index]

    __getitem__ = get_mesh

    def get_mesh_vertex_assignment(self, index: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
        """Return (k,) the texture and (k,) the chart of each vertex of a mesh; 2^32 - 1 at faces without area.

        Charts are numbered from 0 for all meshes together.

        Raises:
            IndexError: there is no such mesh.
        """
        return self._texture_of(index).of_vertices(index)

    def get_mesh_chart_count(self, index: int) -> int:
        """Return the number of charts of a mesh.

        Raises:
            IndexError: there is no such mesh.
        """
        return len(self._texture_of(index).charts_of(index)[0])

    def get_mesh_chart(self, index: int, chart: int) -> Chart:
        """Return a chart of a mesh; charts are numbered from 0 for each mesh.

        Raises:
            IndexError: there is no such mesh or chart.
        """
        texture = self._texture_of(index)
        charts, of_face = texture.charts_of(index)
        if not 0 <= as_index(chart) < len(charts):
            raise IndexError(f"chart index {chart} is not from 0 to {len(charts) - 1}")
        faces = (of_face == chart).nonzero()[0]
        first = texture.first_faces[index]
        return Chart(faces.astype("uint32"), int(texture.soup.texture[first + faces[0]]))

    def _texture_of(self, index: int) -> Texture:
        """Return the textures of all meshes, after an index of a mesh is checked."""
        count = 0 if self._texture is None else len(self._texture.meshes)
        if self._texture is None or not 0 <= as_index(index) < count:
            raise IndexError(f"mesh index {index} is not from 0 to {count - 1}")
        return self._texture

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self._added)

    mesh_count = property(__len__)

    @property
    def atlas_count(self) -> int:
        """The number of textures."""
        return 0 if self._texture is None else len(self._texture.coverage)

    @property
    def chart_image(self) -> NDArray[np.uint8]:
        """(height, width, 3) the image of the first texture, see `get_chart_image`."""
        return self.get_chart_image(0)

    def get_utilization(self, index: int) -> float:
        """Return the covered fraction of a texture."""
        return self.utilization[index]

    def get_chart_image(self, index: int) -> NDArray[np.uint8]:
        """Return (height, width, 3) an image of the charts of a texture in different colours, black elsewhere.

        An image is drawn when it is asked for, and only the last one is cached.

        Raises:
            RuntimeError: images were not requested by `PackOptions.create_image`.
            IndexError: there is no such texture.
            TooLargeError: the texture has more than 16,384 texels along a side.
        """
        from .arrays import draw_charts

        if self._texture is None or not self._has_images:
            raise RuntimeError("the atlas has no image: set create_image of PackOptions")
        if not 0 <= as_index(index) < self.atlas_count:
            raise IndexError(f"texture index {index} is not from 0 to {self.atlas_count - 1}")
        if self._image is None or self._image[0] != index:
            self._image = None  # before another one needs memory
            self._image = index, draw_charts(self._texture, index)
        return self._image[1]


def parametrize(
    positions: ArrayLike, indices: ArrayLike, normals: ArrayLike | None = None, uvs: ArrayLike | None = None
) -> Mapped:
    """Return the UVs of a mesh as `Atlas.get_mesh` does; arguments and errors are those of `Atlas.add_mesh`.

    Unmet guarantees are a `GuaranteeWarning`.
    """
    atlas = Atlas()
    atlas.add_mesh(positions, indices, normals, uvs)
    with inner_calls():
        atlas.generate()
    warn_of(atlas.notes, "`notes` of this warning")
    return atlas[0]


def export(
    path: str | PathLike[str],
    positions: ArrayLike,
    indices: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    normals: ArrayLike | None = None,
) -> None:
    """Write a mesh as OBJ; vertices have the indices of their UVs and normals.

    Without indices, three vertices in a row are a face.

    Raises:
        ArrayShapeError, NonFiniteError, FaceIndexError: arrays have the wrong shape or type, NaN, or wrong indices.
        MeshFileError: the file cannot be written.
    """
    from .arrays import write_obj

    write_obj(path, positions, indices, uvs, normals)
