"""What a flattening returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .base.arrays import FloatArray, IntArray, rows_of
from .base.text import plural
from .stages import SolveStatistics

if TYPE_CHECKING:
    import meshio
    import pyvista
    import trimesh

    from .io.mesh_file import MeshFile
    from .measure.distortion import Distortion
    from .measure.seam_data import Rotations, SeamData


@dataclass(frozen=True, eq=False)
class Flattening:
    """A flattened mesh: n vertices, m triangles, u points in the plane.

    Attributes:
        vertices: (n, 3) positions in model units; the input's own, or the repaired mesh's.
        faces: (m, 3) vertex indices, consistently oriented, in the input's order of faces; of a refinement, its
            triangles, in the order of the faces that they are parts of.
        uv: (u, 2) points of the layout, in [0, 1]^2, all charts at one scale; of UDIM tiles, tile i is one of ten in a
            row, [i % 10, i % 10 + 1] x [i // 10, i // 10 + 1].
        uv_faces: (m, 3) index into `uv` of every triangle corner.
        uv_scale: UV units per model unit; `uv / uv_scale` is the layout at the model's own scale.
        cones: (s,) cone vertices.
        curvatures: (s,) their target curvatures, radians.
        log_scale: (n,) log conformal factor phi, so that flat lengths are about l * exp(phi) in model
            units; NaN at vertices without a face.
        prescribed: (n,) curvature that each vertex is to have in the plane, radians: 0 but for cones and a prescribed
            boundary; NaN where it is free, on other boundaries and on marked seams.
        curvature_residual: (n,) target minus curvature of the flat metric, radians; NaN likewise.
        seams: (k, 2) vertex pairs of the mesh edges that were cut.
        packing_efficiency: area of the layout over that of the texture, or textures.
        distortion: the measures of Section 5 of the paper and their like.
        seconds: wall time of each stage.
        notes: what was done to the input, one sentence each.
        settings: the options it was made with.
        solve: how the metric and the layout were found: Newton steps, flips, untangled triangles.
        rotations: of seams, against multiples of the quantum of the cones; None without one.
        vertex_origin: (n,) the input vertex that each vertex came from.
        face_origin: (m,) the input face that each face came from.
        face_corners: (m, 3) for a mesh read from a file: the polygon corner of `source` at each
            triangle corner; else None.
        source: the file it was read from, if any.
        lengths: (m, 3) the side lengths that were given as a metric of its own, column i opposite corner i; else None.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> result = coneflat.flatten(vertices, faces)
        >>> np.round(result.curvatures / np.pi, 6)  # all four corners are cones of half a turn
        array([1., 1., 1., 1.])
        >>> result.uv.shape, result.seams.shape
        ((6, 2), (3, 2))
    """

    vertices: FloatArray
    faces: IntArray
    uv: FloatArray
    uv_faces: IntArray
    uv_scale: float
    cones: IntArray
    curvatures: FloatArray
    log_scale: FloatArray
    prescribed: FloatArray
    curvature_residual: FloatArray
    seams: IntArray
    packing_efficiency: float
    distortion: Distortion
    seconds: Mapping[str, float]
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    solve: SolveStatistics = field(default_factory=SolveStatistics)
    rotations: Rotations | None = None
    vertex_origin: IntArray | None = None
    face_origin: IntArray | None = None
    face_corners: IntArray | None = None
    source: MeshFile | None = None
    lengths: FloatArray | None = None

    @property
    def corner_uv(self) -> FloatArray:
        """(m, 3, 2) the point of every triangle corner."""
        return rows_of(self.uv, self.uv_faces)

    @cached_property
    def seam_data(self) -> SeamData:
        """The cut as arrays: both sides of every seam edge and the motion between them, charts, cone angles, scales."""
        from .measure.seam_data import seam_data

        return seam_data(self)

    def report(self) -> dict[str, Any]:
        """Return all measures as plain Python values, ready for JSON."""
        from .measure.report import as_dict

        return as_dict(self)

    def save(self, path: str | PathLike[str], *, texture: str | PathLike[str] | None = None) -> Path:
        """Write the textured mesh; the format (.obj, .ply, .glb, .npz) follows the path's ending.

        texture: of a .glb: "checker" for a checkerboard, or an image file that becomes part of it.

        Raises:
            UnknownFormatError, MeshFileError: the ending is unknown, or the file cannot be written, or the texture
                cannot be read.
            OptionError: files of this ending carry no texture, or Pillow is not installed.
        """
        from .io import write_flattening

        return write_flattening(self, path, texture)

    def as_written(self, ending: str) -> Flattening:
        """Return the result as a file of a format holds it, with the measures and notes of that.

        A .glb has numbers of 32 bits; the polygons of an .obj are measured as the fans of triangles that others read.

        Args:
            ending: ".obj", ".ply", ".glb" or ".npz".

        Raises:
            MeshFileError: the file cannot hold numbers so large.
        """
        from .io.write import as_written

        return as_written(self, ending)

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return a textured mesh of trimesh, the vertices split where UVs are.

        Vertex attribute `vertex` is the vertex of the result that each came from, face attribute `chart` the chart.

        Raises:
            OptionError: trimesh is not installed.
        """
        from .io.packages import to_trimesh

        return to_trimesh(self)

    def to_pyvista(self) -> pyvista.PolyData:
        """Return a surface of PyVista with active texture coordinates, the points split where UVs are.

        Point data `vertex` is the vertex of the result that each came from, cell data `chart` the chart.

        Raises:
            OptionError: PyVista is not installed.
        """
        from .io.packages import to_pyvista

        return to_pyvista(self)

    def to_meshio(self) -> meshio.Mesh:
        """Return a mesh of meshio, the points split where UVs are, which are its point data `obj:vt`.

        Point data `vertex` is the vertex of the result that each came from, cell data `chart` the chart.

        Raises:
            OptionError: meshio is not installed.
        """
        from .io.packages import to_meshio

        return to_meshio(self)

    def view(
        self,
        path: str | PathLike[str] | None = None,
        *,
        texture: str | PathLike[str] | None = None,
        up: str = "y",
        show: str | None = None,
        most_triangles: int | None = None,
        color: str | None = None,
    ) -> Path:
        """Write an interactive page, one HTML file that loads nothing from anywhere, and return its path.

        It shows the model and its layout side by side, linked, with a checkerboard, a picture or quality in
        colours, seams and cones.

        Args:
            path: the page, .html; by default a new temporary file, which is opened in the browser.
            texture: a PNG, JPEG, GIF or WebP file to lay on the model.
            up: the model's upward axis in the first view, "x", "y" or "z".
            show: what the colours show first: "checker", "picture", "charts", "qc", "area", "curvature" (of the
                model), "flat" (the curvature left) or "plain".
            most_triangles: a mesh with more is thinned for display; by default half a million.
            color: numbers of your own, shown first: a property of the vertices in the mesh's file, or a file .npy or
                FILE.npz:NAME with one for each vertex or triangle.

        Raises:
            OptionError: `up` or `show` is none of these; there are no such numbers.
            ArrayShapeError, MeshError: there are no UVs, or the mesh cannot be thinned to so few triangles.
            UnknownFormatError, MeshFileError: a file cannot be read or written.
        """
        from .apps.view import check_page, open_page, page_of, write_page
        from .options.declared import MOST_TRIANGLES

        if path is not None:
            check_page(path)
        most = MOST_TRIANGLES if most_triangles is None else most_triangles
        page = write_page(
            page_of(self, texture=texture, up=up, show=show, most_triangles=most, color=color), path
        )
        if path is None:
            open_page(page)
        return page

    def _repr_html_(self) -> str:
        """Return the page in a frame, which notebooks show."""
        from .apps.view import notebook_html

        return notebook_html(self)

    def __repr__(self) -> str:
        return (
            f"<Flattening: {plural(len(self.faces), 'triangle')}, {plural(len(self.cones), 'cone')}, "
            f"{plural(self.distortion.charts, 'chart')}, QC {self.distortion.qc_mean:.4f}>"
        )
