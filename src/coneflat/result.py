"""The result of a flattening."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .base.arrays import FloatArray, IntArray, rows_of
from .base.entry_points import EntryPoint
from .base.notes import new_notes, warn_of, warns
from .base.text import plural
from .stages import SolveStatistics

if TYPE_CHECKING:
    import meshio
    import pyvista
    import trimesh

    from .io.mesh_file import MeshFile
    from .measures.distortion import Distortion
    from .measures.seam_data import Rotations, SeamData

#: Functions of measures, files and the viewer, which import results.
_REPORT = EntryPoint[dict[str, Any]]("measures.report:as_dict")
_SEAM_DATA = EntryPoint["SeamData"]("measures.seam_data:seam_data")
_WRITE = EntryPoint[tuple[Path, "Flattening"]]("io.write:write_stored")
_AS_WRITTEN = EntryPoint["Flattening"]("io.write:as_written")
_TO_TRIMESH = EntryPoint["trimesh.Trimesh"]("io.packages:to_trimesh")
_TO_PYVISTA = EntryPoint["pyvista.PolyData"]("io.packages:to_pyvista")
_TO_MESHIO = EntryPoint["meshio.Mesh"]("io.packages:to_meshio")
_SHOW_PAGE = EntryPoint[Path]("apps.view.page.webpage:show_page")
_NOTEBOOK_HTML = EntryPoint[str]("apps.view.page.webpage:notebook_html")


@dataclass(frozen=True, eq=False)
class Flattening:
    """A flattened mesh: n vertices, m triangles, u points in the plane.

    Attributes:
        vertices: (n, 3) positions in model units: those of the input or of the repaired mesh.
        faces: (m, 3) vertex indices, consistently oriented, in the order of the input's faces.
        uv: (u, 2) points of the layout, in [0, 1]^2, all charts at one scale. With several UDIM tiles, tile i is the
            square [i % 10, i % 10 + 1] x [i // 10, i // 10 + 1].
        uv_faces: (m, 3) index into `uv` of every triangle corner.
        uv_scale: UV units per model unit; `uv / uv_scale` is the layout at the scale of the model.
        cones: (s,) cone vertices.
        curvatures: (s,) their target curvatures, radians.
        log_scale: (n,) log conformal factor phi; flat lengths are about l * exp(phi) in model units. NaN at vertices
            without a face.
        prescribed: (n,) prescribed curvature of each vertex in the plane, radians: 0 except at cones and on a
            prescribed boundary; NaN where it is free, on other boundaries and on marked seams.
        curvature_residual: (n,) target minus curvature of the flat metric, radians; NaN at vertices without a face.
        seams: (k, 2) vertex pairs of the mesh edges that were cut.
        packing_efficiency: area of the layout over the area of the texture or textures.
        distortion: the measures of Section 5 of the paper and others.
        seconds: wall time of each stage.
        notes: repairs of the input, unmet requests and unmet guarantees, one sentence each. The unmet ones are also
            a `GuaranteeWarning`.
        settings: the options of the flattening.
        solve: statistics of the metric and the layout: Newton steps, flips, untangled triangles.
        rotations: deviation of seam rotations from multiples of the cones' quantum; None without a quantum.
        vertex_origin: (n,) the input vertex that each vertex came from.
        face_origin: (m,) the input face that each face came from.
        face_corners: (m, 3) for a mesh read from a file: the polygon corner of `source` at each
            triangle corner; else None.
        source: the file that the mesh was read from, if any.
        lengths: (m, 3) the side lengths given by the option `lengths`, column i opposite corner i; else None.

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
        """(m, 3, 2) the UV point of every triangle corner."""
        return rows_of(self.uv, self.uv_faces)

    @cached_property
    def seam_data(self) -> SeamData:
        """The cut as arrays: both sides of each seam edge and the motion between them, charts, cone angles, scales."""
        return _SEAM_DATA(self)

    def report(self) -> dict[str, Any]:
        """Return all measures as plain Python values, ready for JSON."""
        return _REPORT(self)

    def save(
        self,
        path: str | PathLike[str],
        *,
        texture: str | PathLike[str] | None = None,
        uv_set: int | None = None,
    ) -> Path:
        """Write the mesh with its UVs to a file and return its path.

        Args:
            path: the file; its extension selects the format (.obj, .ply, .glb, .npz).
            texture: for a .glb: "checker" for a checkerboard, or an image file to embed.
            uv_set: 1 for a .glb to have the UVs as a second set, TEXCOORD_1, beside those of the textures; 0 replaces
                these. By default 1 for a lightmap (see `coneflat.unwrap`) in a .glb, otherwise 0.

        Raises:
            UnknownFormatError: the extension is unknown.
            MeshFileError: the file cannot be written, or the texture cannot be read.
            OptionError: the format cannot contain a texture or the UV set, or Pillow is not installed.
        """
        written, stored = _WRITE(self, path, texture, uv_set)
        # Rounding to the numbers of the format can break guarantees.
        warn_of(new_notes(stored, self), f"result.as_written('{written.suffix.lower()}').notes")
        return written

    @warns()
    def as_written(self, ending: str, *, uv_set: int | None = None) -> Flattening:
        """Return the result as a file of the given format stores it, measured again.

        A .glb stores 32-bit numbers. The polygons of an .obj are measured as fans of triangles, as most programs split
        them.

        Args:
            ending: the file extension: ".obj", ".ply", ".glb" or ".npz".
            uv_set: as of `save`.

        Raises:
            MeshFileError: numbers are too large for the format.
            OptionError: the format does not have the UV set.
        """
        return _AS_WRITTEN(self, ending, uv_set=uv_set)

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return a textured trimesh mesh, whose vertices are split at seams.

        The vertex attribute `vertex` is the vertex of the result, the face attribute `chart` the chart.

        Raises:
            OptionError: trimesh is not installed.
        """
        return _TO_TRIMESH(self)

    def to_pyvista(self) -> pyvista.PolyData:
        """Return a PyVista surface with 32-bit active texture coordinates, whose points are split at seams.

        The point data `vertex` is the vertex of the result, the cell data `chart` the chart.

        Raises:
            OptionError: PyVista is not installed.
        """
        return _TO_PYVISTA(self)

    def to_meshio(self) -> meshio.Mesh:
        """Return a meshio mesh, whose points are split at seams; UVs are the point data `obj:vt`.

        The point data `vertex` is the vertex of the result, the cell data `chart` the chart.

        Raises:
            OptionError: meshio is not installed.
        """
        return _TO_MESHIO(self)

    def view(
        self,
        path: str | PathLike[str] | None = None,
        *,
        texture: str | PathLike[str] | None = None,
        up: str = "auto",
        show: str | None = None,
        most_triangles: int | None = None,
        color: str | None = None,
        qc_max: float | None = None,
        scale_max: float | None = None,
    ) -> Path:
        """Write an interactive page, one self-contained HTML file, and return its path.

        It shows the model next to its layout, linked, with a checkerboard, a picture or colour-coded quality, with
        seams and cones.

        Args:
            path: the page, .html; by default a new temporary file, which is opened in the browser.
            texture: a PNG, JPEG, GIF or WebP file to map onto the model.
            up: the model's upward axis in the first view, "x", "y" or "z"; "auto" is that of its format or shape.
            show: what the colours show first: "checker", "picture", "charts", "qc", "area", "strain",
                "faults" (of the UVs), "curvature" (of the model), "flat" (the remaining curvature) or "plain".
            most_triangles: a mesh with more triangles is simplified for display; by default half a million.
            color: values to show first: the name of a vertex property in the mesh's file, or a file .npy or
                FILE.npz:NAME with one number per vertex or triangle.
            qc_max: QC distortion at the end of its colour scale, so that pages can be compared; by default it fits.
            scale_max: area scale at the end of its colour scale, which begins at the reciprocal.

        Raises:
            OptionError: `up` or `show` is not one of these; `color` is not found.
            ArrayShapeError, MeshError: there are no UVs, or the mesh cannot be simplified to so few triangles.
            UnknownFormatError, MeshFileError: a file cannot be read or written.
        """
        return _SHOW_PAGE(
            self,
            path,
            texture=texture,
            up=up,
            show=show,
            most_triangles=most_triangles,
            color=color,
            qc_max=qc_max,
            scale_max=scale_max,
        )

    def _repr_html_(self) -> str:
        """Return the page as an HTML frame for notebooks."""
        return _NOTEBOOK_HTML(self)

    def __repr__(self) -> str:
        return (
            f"<Flattening: {plural(len(self.faces), 'triangle')}, {plural(len(self.cones), 'cone')}, "
            f"{plural(self.distortion.charts, 'chart')}, QC {self.distortion.qc_mean:.4f}>"
        )
