"""The options of the package xatlas."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class ChartOptions:
    """The options for charts of xatlas, which have no effect here, and one that xatlas does not have.

    Attributes:
        search_time: seconds after which the search for seams ends, see `coneflat.unwrap`; None for no limit.
    """

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
    search_time: float | None = None


@dataclass
class PackOptions:
    """The options for packing of xatlas.

    Attributes:
        padding: texels between charts, and between charts and the border, at least; 0 for the default.
        resolution: texels along a side of a texture; 0 for that of `texels_per_unit`, or else 1024.
        texels_per_unit: texels per unit of length, at least: with a resolution, in as many textures as it needs, and
            otherwise in one. 0 for one texture of the resolution.
        blockAlign: charts begin at corners of blocks of 4 texels.
        create_image: permit `Atlas.chart_image`. The other options have no effect.
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
