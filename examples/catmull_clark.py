"""Catmull-Clark subdivision of a mesh of quads: `python examples/catmull_clark.py quads.obj finer.obj 2`.

E. Catmull, J. Clark, "Recursively generated B-spline surfaces on arbitrary topological meshes", 1978. The output
of `coneflat quads` is a control mesh for it: the limit surface is C2 except at the few irregular vertices.
"""

from __future__ import annotations

import sys

import numpy as np


def catmull_clark(vertices, quads):
    """Return the vertices (q, 3) and quads (4 p, 4) after one step, of (n, 3) and (p, 4); boundaries are B-splines.

    The first n vertices are those of before, moved; then come those of edges, and those of quads.
    """
    count, corners = len(vertices), np.asarray(quads)
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, edge_of, beside = np.unique(
        np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    edge_of, is_border = edge_of.reshape(-1, 4), beside == 1

    middles = vertices[corners].mean(axis=1)
    around = np.zeros((len(edges), 3))
    np.add.at(around, edge_of, middles[:, None])
    halves = vertices[edges].mean(axis=1)
    of_edges = np.where(is_border[:, None], halves, (2 * halves + around) / 4)

    valence = np.bincount(edges.ravel(), minlength=count)[:, None]
    faces = np.bincount(corners.ravel(), minlength=count)[:, None]
    mean_of_faces, mean_of_halves = np.zeros((count, 3)), np.zeros((count, 3))
    np.add.at(mean_of_faces, corners, middles[:, None])
    np.add.at(mean_of_halves, edges, halves[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):  # vertices of no quad
        moved = (mean_of_faces / faces + 2 * mean_of_halves / valence + (valence - 3) * vertices) / valence
    on_border = np.zeros((count, 3))
    np.add.at(on_border, edges[is_border], halves[is_border][:, None])
    ends = np.unique(edges[is_border])
    # A corner, which has one quad, stays.
    moved[ends] = np.where(faces[ends] == 1, vertices[ends], on_border[ends] / 4 + vertices[ends] / 2)

    along, before = count + edge_of, count + np.roll(edge_of, 1, axis=1)
    centre = count + len(edges) + np.repeat(np.arange(len(corners))[:, None], 4, axis=1)
    finer = np.stack([corners, along, centre, before], axis=2).reshape(-1, 4)
    return np.concatenate([moved, of_edges, middles]), finer


def main() -> None:
    """Subdivide a file."""
    from coneflat import read_mesh

    mesh = read_mesh(sys.argv[1])
    vertices, quads = mesh.vertices, mesh.corners.reshape(-1, 4)
    for _ in range(int(sys.argv[3]) if len(sys.argv) > 3 else 1):
        vertices, quads = catmull_clark(vertices, quads)
    with open(sys.argv[2], "w", encoding="utf-8") as file:
        file.writelines("v {!r} {!r} {!r}\n".format(*place) for place in vertices.tolist())
        file.writelines("f {} {} {} {}\n".format(*quad) for quad in (quads + 1).tolist())


if __name__ == "__main__":
    main()
