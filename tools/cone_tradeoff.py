"""Measure what the number of cones does to a layout: `python tools/cone_tradeoff.py FOLDER`.

Flattens every model of a folder for a range of allowed area distortions, prints the table of docs/cones.md, and draws
its picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import coneflat
from coneflat.view import new_figure, save_figure

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
ALLOWED = (0.5, 0.35, 0.25, 0.2, 0.15, 0.1, 0.07)
ENDINGS = (".obj", ".ply", ".off")
PIXELS = 1200
MEASURES = ("cones", "QC distortion", "seam length, √area", "overlap, % of area", "exact E")


def overlap(result: coneflat.Flattening) -> float:
    """Return the share of the layout's area that lies over other parts of it, by counting pixels."""
    corners = result.corner_uv * (PIXELS - 1)
    low = np.ceil(corners.min(axis=1) - 0.5).astype(np.int64)
    size = np.maximum(np.floor(corners.max(axis=1) - 0.5).astype(np.int64) - low + 1, 0)
    face = np.repeat(np.arange(len(corners)), size.prod(axis=1))
    step = np.arange(len(face)) - np.repeat(
        np.cumsum(size.prod(axis=1)) - size.prod(axis=1), size.prod(axis=1)
    )
    x, y = low[face, 0] + step % size[face, 0], low[face, 1] + step // size[face, 0]
    points = np.stack([x + 0.5, y + 0.5], axis=1)
    inside = np.ones(len(face), dtype=bool)
    for i in range(3):
        one, two = corners[face, i], corners[face, (i + 1) % 3]
        side, to = two - one, points - one
        inside &= side[:, 0] * to[:, 1] - side[:, 1] * to[:, 0] >= 0
    counts = np.bincount(y[inside] * PIXELS + x[inside])
    return float(1 - np.count_nonzero(counts) / counts.sum())


def main(folder: Path) -> None:
    """Print the table and draw the picture."""
    rows: dict[float, list[tuple[float, ...]]] = {allowed: [] for allowed in ALLOWED}
    names = []
    for path in sorted(path for path in folder.iterdir() if path.suffix in ENDINGS):
        try:
            model = coneflat.read_mesh(path)
            for allowed in ALLOWED:
                result = coneflat.flatten(model, distortion=allowed)
                d = result.distortion
                rows[allowed].append(
                    (
                        len(result.cones),
                        d.qc_mean,
                        d.seam_length,
                        100 * overlap(result),
                        result.solve.area_distortion,
                    )
                )
        except coneflat.ConeflatError as error:
            print(f"{path.name}: {error}", file=sys.stderr)
            continue
        names.append(path.stem)
        print(path.name, *(f"{row[-1][0]}" for row in rows.values()), file=sys.stderr, flush=True)
    table = np.array([rows[allowed] for allowed in ALLOWED])  # (a, models, measures)
    print(f"| E allowed | {' | '.join(MEASURES)} |")
    print("| --- " * (len(MEASURES) + 1) + "|")
    for allowed, values in zip(ALLOWED, np.median(table, axis=1), strict=True):
        print(
            f"| {allowed} | {values[0]:.0f} | {values[1]:.4f} | {values[2]:.2f} | {values[3]:.1f} | {values[4]:.3f} |"
        )

    figure = new_figure(13.0, 3.6)
    for k, name in enumerate(MEASURES[:4]):
        axes = figure.add_axes((0.05 + 0.245 * k, 0.15, 0.19, 0.72))
        axes.plot(ALLOWED, table[:, :, k], color="#9db4c8", linewidth=0.8)
        axes.plot(
            ALLOWED,
            np.median(table[:, :, k], axis=1),
            color="#b0413e",
            linewidth=2.2,
            marker="o",
            markersize=4,
        )
        axes.axvline(0.2, color="#888888", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xticks(ALLOWED, [f"{allowed:g}" for allowed in ALLOWED], fontsize=7)
        axes.minorticks_off()
        axes.invert_xaxis()
        axes.set_ylim(*{0: (0, 60), 1: (1, 1.15), 2: (0, 8), 3: (0, 60)}[k])
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("area distortion E allowed", fontsize=9)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    print(f"wrote {save_figure(figure, IMAGES / 'tradeoff.png')}, from {', '.join(names)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
