"""Draw the pictures of the documentation: `python tools/make_images.py [MODEL]`.

The sample's picture is that of `coneflat demo`. The picture of the curvature left after flattening takes a model
file, the sample if none is given, and so does that of cones of whole quarter turns.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import coneflat
from coneflat.view import demo_figure, draw_checker, new_figure, render_mesh, save_figure

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
LOWEST, HIGHEST = -16, -1  # decades of curvature error that the colours span


def curvature_figure(path: Path) -> Any:
    """Return a figure of what curvature a model has, and what the linear and the exact metric leave of it."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    linear = coneflat.flatten(path, **coneflat.PAPER)
    exact = coneflat.flatten(path)
    mesh = coneflat.TriangleMesh(exact.vertices, exact.faces)
    angles = coneflat.corner_angles(coneflat.edge_lengths(mesh.vertices, mesh.faces))
    before = np.abs(coneflat.angle_defect(mesh.faces, angles, mesh.is_boundary_vertex))
    figure = new_figure(15.0, 5.2)
    colors = colormaps["magma"]
    panels = [("on the model", before), ("left by the linear metric", np.abs(linear.curvature_residual)),
              ("left by the exact metric", np.abs(exact.curvature_residual))]  # fmt: skip
    for k, (label, values) in enumerate(panels):
        share = (np.log10(np.maximum(values, 1e-300)) - LOWEST) / (HIGHEST - LOWEST)
        shade = colors(np.clip(share, 0, 1)[mesh.faces].mean(axis=1))[:, :3]
        picture = render_mesh(mesh.vertices, mesh.faces, face_colors=shade)
        axes = figure.add_axes((0.01 + 0.305 * k, 0.02, 0.295, 0.84))
        axes.imshow(picture.image)
        axes.set_axis_off()
        figure.text(0.015 + 0.305 * k, 0.93, f"Curvature {label}", size=13)
        spread = f"root mean square {np.sqrt(np.mean(values**2)):.1e} rad, largest {values.max():.1e}"
        figure.text(0.015 + 0.305 * k, 0.88, spread, size=11, color="#444444")
    bar = figure.colorbar(
        ScalarMappable(LogNorm(10.0**LOWEST, 10.0**HIGHEST), colors),
        cax=figure.add_axes((0.945, 0.1, 0.01, 0.7)),
    )
    bar.ax.set_title("|K|, rad", size=11)
    return figure


def quarters_figure(path: Path) -> Any:
    """Return a figure of a model with a checkerboard: with any cones, and with cones of whole quarter turns."""
    figure = new_figure(13.0, 6.6)
    quarters = {"quantum": np.pi / 2, "correct_handles": True}
    for k, (label, options) in enumerate((("Any curvatures", {}), ("Multiples of a quarter turn", quarters))):
        result = coneflat.flatten(path, **options)
        axes = figure.add_axes((0.01 + 0.5 * k, 0.01, 0.48, 0.88))
        axes.set_axis_off()
        draw_checker(result, axes, cones=True)
        figure.text(0.015 + 0.5 * k, 0.945, label, size=13)
        off = (
            ""
            if result.rotations is None
            else f"; seams are off quarter turns by {result.rotations.worst:.0e} rad"
        )
        figure.text(0.015 + 0.5 * k, 0.905, f"{len(result.cones)} cones{off}", size=11, color="#444444")
    return figure


def main() -> None:
    """Draw everything."""
    sample = coneflat.sample_path()
    save_figure(demo_figure(coneflat.flatten(sample)), IMAGES / "sample.png")
    model = Path(sys.argv[1]) if len(sys.argv) > 1 else sample
    save_figure(curvature_figure(model), IMAGES / "curvature.png")
    save_figure(quarters_figure(model), IMAGES / "quarters.png")


if __name__ == "__main__":
    main()
