"""`coneflat.unwrap` with the interface of the package xatlas; see `coneflat.xatlas`.

What needs more than Python is in `arrays.py`, so that `import coneflat.xatlas` is fast.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import index as as_index
from os import PathLike
from typing import TYPE_CHECKING

from ...base import inner_calls, warn_of, warns
from .options import ChartOptions, PackOptions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from .arrays import Mapped, MeshArrays


class Utilization(float):
    """The covered fraction of the only texture; it may also be taken by index, as from a list of one for each."""

    def __getitem__(self, index: int) -> float:
        """Return the covered fraction of a texture."""
        return [float(self)][index]


@dataclass(eq=False)
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
    _added: list[MeshArrays] = field(default_factory=list, repr=False)
    _mapped: tuple[Mapped, ...] = field(default=(), repr=False)
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
        from .arrays import draw_charts, unwrap_meshes

        pack = PackOptions() if pack_options is None else pack_options
        chart = ChartOptions() if chart_options is None else chart_options
        texture = unwrap_meshes(self._added, pack, chart.search_time)
        self.notes = texture.soup.notes
        self.width = self.height = texture.side
        self.texels_per_unit = texture.side * texture.soup.scale
        self.utilization = Utilization(texture.soup.efficiency)
        self.chart_count = texture.chart_count
        self._mapped = texture.meshes
        self._image = draw_charts(texture) if pack.create_image else None

    def get_mesh(self, index: int) -> Mapped:
        """Return a mesh: (k,) the input vertex of each vertex, (m, 3) faces in the given order, and (k, 2) UVs.

        Raises:
            IndexError: there is no such mesh.
        """
        if not 0 <= as_index(index) < len(self._mapped):
            raise IndexError(f"mesh index {index} is not from 0 to {len(self._mapped) - 1}")
        return self._mapped[index]

    __getitem__ = get_mesh

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self._added)

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
