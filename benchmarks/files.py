"""Time and memory of reading and writing files: `python benchmarks/files.py` prints a Markdown table.

Reading a mesh in each format, and writing its flattening, against the flattening itself in memory, in the same run.
Each file is read or written by a separate process, which loads all code with a small file before the measurement;
memory is the peak of that process, which includes the result when writing. The model is one of `../shared/meshes`, or
a bumpy sphere if it is missing, subdivided (each triangle into four) up to --largest triangles. Wall time, the best of
--runs.
"""

from __future__ import annotations

import argparse
import json
import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from common import best_time, cases, model, peak_memory, shapes

from coneflat import flatten, read_mesh
from coneflat.io import lines_of

#: For each format: the input to read and the extension of the output to write, if supported.
FORMATS = {
    "OBJ": ("mesh.obj", ".obj"),
    "PLY, binary": ("mesh.ply", ".ply"),
    "PLY, text": ("text.ply", None),
    "GLB": ("mesh.glb", ".glb"),
    "glTF": ("mesh.gltf", None),
    "STL, binary": ("mesh.stl", None),
    "STL, text": ("text.stl", None),
    "OFF": ("mesh.off", None),
    "NPZ": (None, ".npz"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="bunny")
    parser.add_argument("--largest", type=int, default=500_000, help="triangles")
    parser.add_argument("--runs", type=int, default=2, help="the best counts")
    parser.add_argument("--one", nargs="+", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(TASKS[arguments.one[0]](*arguments.one[1:])))
        return
    *_, (name, rounds) = cases([arguments.model], arguments.largest)
    with TemporaryDirectory() as folder:
        flattening = child("flatten", folder, name, str(rounds))
        print(
            f"{name}, {flattening['triangles']:,} triangles: the flattening takes {flattening['seconds']:.1f} s and "
            f"{flattening['memory']:.0f} MB.\n"
        )
        print(
            "| format | input, MB | read, s | of the flattening | peak, MB | output, MB | write, s | of it | peak, MB |"
        )
        print("| --- " * 9 + "|")
        for label, (source, ending) in FORMATS.items():
            cells = [label]
            for task, argument in (("read", source), ("write", ending)):
                if argument is None:
                    cells += [""] * 4
                    continue
                row = child(task, folder, argument, str(arguments.runs))
                share = row["seconds"] / flattening["seconds"]
                cells += [
                    f"{row['size']:.0f}",
                    f"{row['seconds']:.2f}",
                    f"{share:.1%}",
                    f"{row['memory']:.0f}",
                ]
            print("| " + " | ".join(cells) + " |", flush=True)


def child(*task: str) -> dict:
    command = [sys.executable, __file__, "--one", *task]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def flattened(folder: str, name: str, rounds: str) -> dict:
    """Write a model and a small one in all formats, flatten both, and store the results."""
    costs = {}
    for size, mesh in (("small", shapes.sphere(5)), ("large", model(name, int(rounds)))):
        place = Path(folder) / size
        place.mkdir()
        write_inputs(place, *mesh)
        source = read_mesh(place / "mesh.obj")
        start = time.perf_counter()
        result = flatten(source)
        costs = {
            "triangles": len(result.faces),
            "seconds": time.perf_counter() - start,
            "memory": peak_memory(),
        }
        (place / "result.pickle").write_bytes(pickle.dumps(result))
    return costs


def read(folder: str, name: str, runs: str) -> dict:
    read_mesh(Path(folder) / "small" / name)
    path = Path(folder) / "large" / name
    seconds = best_time(lambda: read_mesh(path), int(runs))
    pieces = path.parent.glob("gltf_buffer*") if path.suffix == ".gltf" else ()
    return {
        "seconds": seconds,
        "memory": peak_memory(),
        "size": sum(p.stat().st_size for p in (path, *pieces)) / 1e6,
    }


def write(folder: str, ending: str, runs: str) -> dict:
    small, result = (
        pickle.loads((Path(folder) / size / "result.pickle").read_bytes()) for size in ("small", "large")
    )
    path = Path(folder) / f"output{ending}"
    small.save(path)
    seconds = best_time(lambda: result.save(path), int(runs))
    return {"seconds": seconds, "memory": peak_memory(), "size": path.stat().st_size / 1e6}


TASKS: dict[str, Callable[..., dict]] = {"flatten": flattened, "read": read, "write": write}


def write_inputs(folder: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    """Write a mesh in all input formats: double precision in text except STL, single precision in binary."""
    import trimesh

    points = b"".join(lines_of("", vertices, b"\n"))
    polygons = ("3 %d %d %d\n" * len(faces) % tuple(faces.ravel().tolist())).encode()
    with open(folder / "mesh.obj", "wb") as file:
        file.writelines(lines_of("v", vertices, b"\n"))
        file.write(("f %d %d %d\n" * len(faces) % tuple((faces + 1).ravel().tolist())).encode())
    (folder / "mesh.off").write_bytes(b"OFF\n%d %d 0\n" % (len(vertices), len(faces)) + points + polygons)
    (folder / "text.ply").write_bytes(ply_header("ascii", "double", vertices, faces) + points + polygons)
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    header = ply_header("binary_little_endian", "float", vertices, faces)
    (folder / "mesh.ply").write_bytes(header + vertices.astype("<f4").tobytes() + rows.tobytes())
    triangles = np.zeros(len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = vertices[faces]
    (folder / "mesh.stl").write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + triangles.tobytes())
    facet = "facet normal 0 0 1\nouter loop\n" + 3 * "vertex %.6e %.6e %.6e\n" + "endloop\nendfacet\n"
    with open(folder / "text.stl", "w") as file:
        file.write("solid mesh\n")
        for block in np.array_split(vertices[faces].reshape(-1, 9), 1 + len(faces) // 100_000):
            file.write(facet * len(block) % tuple(block.ravel().tolist()))
        file.write("endsolid mesh\n")
    scene = trimesh.Scene(trimesh.Trimesh(vertices, faces, process=False))
    (folder / "mesh.glb").write_bytes(scene.export(file_type="glb"))
    for name, content in scene.export(file_type="gltf").items():
        (folder / name.replace("model.gltf", "mesh.gltf")).write_bytes(content)


def ply_header(form: str, kind: str, vertices: np.ndarray, faces: np.ndarray) -> bytes:
    lines = ["ply", f"format {form} 1.0", f"element vertex {len(vertices)}"]
    lines += [f"property {kind} {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode()


if __name__ == "__main__":
    main()
