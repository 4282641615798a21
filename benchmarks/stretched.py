"""Effect of anisotropic scaling of the model: `python benchmarks/stretched.py` prints a Markdown table.

Models of `../shared/meshes`, where they are, stretched along each axis by each factor and flattened as by default:
flipped triangles or without area in the plane, mean and worst QC, processor time relative to the model as it is,
cones, the worst relative difference of two sides of a seam, and how far the angles around a vertex are off. Rows are
the worst of the three axes.
"""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import numpy as np
from common import model

from coneflat import Flattening, GuaranteeWarning, flatten

MODELS = "knight,spot,3holes,elephant,fandisk,hand,rocker-arm,human,camelhead,bunny,face"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default=MODELS)
    parser.add_argument("--factors", default="3,10,30,100")
    arguments = parser.parse_args()
    columns = (
        "model|triangles|stretched|flipped|degenerate|QC|worst|time|cones|E|seams differ|angles off, rad"
    )
    print(f"| {' | '.join(columns.split('|'))} |\n{'| --- ' * (columns.count('|') + 1)}|")
    for name in arguments.models.split(","):
        vertices, faces = model(name, 0)
        flatten(vertices, faces)  # This compiles or loads the kernels.
        result, unit = timed(vertices, faces)
        print(line(name, 1.0, [(result, unit)], unit, len(faces)), flush=True)
        for factor in (float(word) for word in arguments.factors.split(",")):
            runs = []
            for axis in range(3):
                stretch = np.where(np.arange(3) == axis, factor, 1.0)
                runs.append(timed(vertices * stretch, faces))
            print(line(name, factor, runs, unit, len(faces)), flush=True)


def timed(vertices: Any, faces: Any) -> tuple[Flattening, float]:
    """Return a flattening and its seconds of processor time; the table says what it does not meet."""
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GuaranteeWarning)
        result = flatten(vertices, faces, repair=True)
    return result, time.process_time() - start


def line(name: str, factor: float, runs: list[tuple[Flattening, float]], unit: float, count: int) -> str:
    """Return the row of a model stretched by a factor: the worst values of several results and their seconds."""
    results = [result for result, _ in runs]
    measures = [result.distortion for result in results]
    cells = [
        name,
        f"{count:,}",
        f"{factor:g}",
        f"{max(distortion.flipped for distortion in measures)}",
        f"{max(distortion.degenerate for distortion in measures)}",
        f"{max(distortion.qc_mean for distortion in measures):.3f}",
        f"{max(distortion.qc_max for distortion in measures):.3g}",
        f"{max(seconds for _, seconds in runs) / unit:.1f}",
        f"{max(len(result.cones) for result in results)}",
        f"{max(result.solve.area_distortion for result in results):.2f}",
        f"{max(distortion.seam_mismatch_max for distortion in measures):.0e}",
        f"{max(distortion.angle_sum_error for distortion in measures):.0e}",
    ]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
