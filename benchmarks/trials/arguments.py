"""Odd arguments to every public function."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes

Random = np.random.Generator

# fmt: off
#: Values of all types that a function may be given by mistake.
PLAIN: tuple[Any, ...] = (
    None, "", "abc", "auto", "nan", b"x", 0, 1, -1, 3, 2.5, -0.0, 1e308, -1e308, 1e-320, 1e-20, math.nan, math.inf,
    -math.inf, 2**31, 2**63, 2**70, True, False, 1j, (), [], {}, [[]], [0], [0, 1, 2], (1, 2, 3), [None], ["a"],
    [math.nan], [[0, 1]], [[0, 1, 2]], [[0, 1], [2]], {"a": 1}, {0: "x"}, {0: math.nan}, {0: None},
    {0: 1.0, 1: None}, {1.5: 2}, {(0, 1): 2}, {10**30: 1.0}, range(3), object(), int, len,
    Path("/nowhere/mesh.obj"), Path("."), "/dev/null", "\0", "ä\t", "x" * 300,
)
#: Those that are used up, or could be changed, by whoever takes them.
FRESH: tuple[Callable[[], Any], ...] = (
    lambda: set(), lambda: {0, 1}, lambda: iter([0, 1]), lambda: (i for i in range(3)), lambda: np.array([]),
    lambda: np.array(3), lambda: np.array(1.5), lambda: np.array([0, 1]), lambda: np.array([1.5, math.nan]),
    lambda: np.zeros((3, 3)), lambda: np.zeros((0, 3)), lambda: np.zeros((4, 3), np.int8), lambda: np.array(["a"]),
    lambda: np.array([None]), lambda: np.array([1 + 2j]), lambda: np.array([True, False]),
    lambda: np.zeros((2, 2, 2, 2)), lambda: np.float32(1.5), lambda: np.int8(4), lambda: np.datetime64("2020-01-01"),
    lambda: np.zeros(3, [("a", "f8")]), lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    lambda: np.full((20, 3), math.nan), lambda: np.eye(3) * 1e308, lambda: np.array([[0, 1, 2]], np.uint64),
    lambda: np.array([[0, 1, 2**40]]), lambda: np.arange(30).reshape(10, 3), lambda: np.float16(3),
    lambda: np.str_("exact"), lambda: np.array("exact"), lambda: memoryview(b"abc"),
)
# fmt: on

#: Functions that take whatever a person gives; the others are blocks to build with, for arrays that these made.
DOORS = (
    "flatten",
    "read_mesh",
    "read_flattening",
    "check_mesh",
    "cone_curve",
    "find_cones",
    "save",
    "view",
    "make_figure",
)


class Calls:
    """Valid calls of the public functions, whose arguments are then replaced."""

    def __init__(self, folder: Path) -> None:
        import coneflat as cf

        self.folder = folder
        vertices, faces = shapes.hill(5, 4)
        mesh = cf.check_mesh(vertices, faces).mesh
        lengths = cf.geometry.edge_lengths(vertices, faces)
        result = cf.flatten(vertices, faces, max_cones=3)
        angles = cf.geometry.corner_angles(lengths)
        curvature = cf.geometry.angle_defect(faces, angles, mesh.is_boundary_vertex)
        surface = {
            "laplacian": cf.geometry.cotangent_laplacian(
                faces, cf.geometry.cotangents(lengths), len(vertices)
            ),
            "curvature": curvature,
            "is_boundary": mesh.is_boundary_vertex,
            "euler_characteristic": mesh.euler_characteristic,
        }
        model = folder / "hill.obj"
        result.save(model)
        result.save(folder / "hill.npz")
        costs = cf.seams.edge_costs(mesh, lengths.ravel()[mesh.edge_halfedges[:, 0]])
        inner = np.flatnonzero(~mesh.is_boundary_vertex)
        seams = cf.seams.find_seams(mesh, inner[:1], costs)
        self.result = result
        self.good: dict[str, dict[str, Any]] = {
            "flatten": {"mesh": vertices, "faces": faces},
            "read_mesh": {"path": model, "weld": None},
            "read_flattening": {"path": folder / "hill.npz"},
            "check_mesh": {"vertices": vertices, "faces": faces, "repair": False},
            "cone_curve": {"mesh": vertices, "faces": faces, "most": 3},
            "find_cones": {"mesh": vertices, "faces": faces},
            "save": {"path": folder / "out.obj"},
            "view": {"path": folder / "page.html"},
            "make_figure": {"shown": result, "kind": "layout"},
            "TriangleMesh": {"vertices": vertices, "faces": faces},
            "measure": {"mesh": mesh, "corner_uv": result.corner_uv},
            "edge_lengths": {"vertices": vertices, "faces": faces},
            "corner_angles": {"lengths": lengths},
            "cotangents": {"lengths": lengths},
            "mollify": {"lengths": lengths},
            "angle_defect": {"faces": faces, "angles": angles, "is_boundary_vertex": mesh.is_boundary_vertex},
            "cotangent_laplacian": {
                "faces": faces,
                "cots": cf.geometry.cotangents(lengths),
                "vertex_count": len(vertices),
            },
            "greedy_cones": dict(surface),
            "cones_at": {**surface, "cones": inner[:2]},
            "cones_with_curvature": {**surface, "cones": inner[:2], "curvatures": np.array([0.1, -0.1])},
            "scaled_lengths": {"lengths": lengths, "faces": faces, "log_scale": np.zeros(len(vertices))},
            "find_seams": {"mesh": mesh, "cones": inner[:1], "edge_costs": costs},
            "edge_costs": {"mesh": mesh, "lengths": lengths.ravel()[mesh.edge_halfedges[:, 0]]},
            "visible_share": {"vertices": vertices, "faces": faces},
            "cut_open": {"mesh": mesh, "seams": seams},
            "least_squares_layout": {"disk": cf.mesh.cut_open(mesh, seams).mesh, "lengths": lengths},
        }

    def function(self, name: str) -> Callable[..., Any]:
        import coneflat as cf

        if name in ("save", "view"):
            return getattr(self.result, name)
        homes = (cf, cf.geometry, cf.cones, cf.metric, cf.seams, cf.mesh, cf.layout)
        return getattr(next(home for home in homes if hasattr(home, name)), name)

    def make(self, rng: Random) -> tuple[str, dict[str, Any], str]:
        """Return the name of a function, arguments, and a description of what is odd."""
        name = "flatten" if rng.random() < 0.45 else sorted(self.good)[int(rng.integers(len(self.good)))]
        if name in ("make_figure", "view", "cone_curve") and rng.random() < 0.6:
            name = "check_mesh"  # these take long
        arguments = dict(self.good[name])
        signature = inspect.signature(self.function(name)).parameters.values()
        every = [
            parameter.name
            for parameter in signature
            if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
        ]
        every = [parameter for parameter in every if parameter != "progress"] or list(arguments)
        odd = []
        for _ in range(1 + (rng.random() < 0.2)):
            which = every[int(rng.integers(len(every)))]
            number = int(rng.integers(len(PLAIN) + len(FRESH)))
            arguments[which] = PLAIN[number] if number < len(PLAIN) else FRESH[number - len(PLAIN)]()
            odd.append(f"{which}={' '.join(repr(arguments[which]).split())[:80]}")
        return name, arguments, f"{name}({', '.join(odd)})"
