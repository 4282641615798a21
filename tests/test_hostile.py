"""The hostile trial and the trial of grids: a slice of their cases, and planted faults that their checks find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from trials.cases import cases, run_case
from trials.grids import check_grid, check_quads
from trials.outcome import Outcome
from trials.promises import check
from trials.textures import check_energy
from trials.workers import MEMORY, run_all
from trials.written import check_file

import coneflat
from coneflat import integer_grid
from coneflat import quads as find_quads

#: Cases of the slice.
SLICE = 100


def outcomes_of(chosen, **limits):
    outcomes: list[Outcome] = []
    run_all(chosen, 1, lambda outcome, _: outcomes.append(outcome), **limits)
    return outcomes


def breaches_of(result, options, vertices, faces):
    outcome = Outcome("mesh", 0)
    check(outcome, result, options, vertices, faces)
    return [cause for cause, _ in outcome.breaches]


@pytest.mark.slow
def test_hostile_cases_break_no_promise():
    outcomes = outcomes_of(cases(SLICE, 0))
    assert len(outcomes) == SLICE
    broken = [
        f"{outcome.kind}:{outcome.seed} {cause}: {details}"
        for outcome in outcomes
        for cause, details in outcome.breaches
    ]
    assert not broken, "\n".join(broken)
    # Refusing everything is not a way to keep promises.
    assert sum(outcome.status in ("ok", "noted") for outcome in outcomes) > SLICE / 2


def test_a_case_is_the_same_whenever_it_is_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, second = (run_case("mesh", 2) for _ in range(2))
    assert (first.recipe, first.status, first.message) == (second.recipe, second.status, second.message)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_crashes_hangs_and_swollen_memory_are_told_and_survived():
    kinds = ("crash", "swell", "mesh")
    told = {outcome.kind: outcome for outcome in outcomes_of([(kind, 2) for kind in kinds])}
    assert set(told) == set(kinds)
    told |= {outcome.kind: outcome for outcome in outcomes_of([("hang", 2)], most_work=2.0)}
    assert told["crash"].breaches[0][0].startswith("crash")
    assert told["hang"].breaches[0][0].startswith("out of time")
    assert told["swell"].breaches[0][0] == "out of memory"
    assert told["swell"].memory > MEMORY
    assert not told["mesh"].breaches


@pytest.fixture(scope="module")
def ball():
    mesh = shapes.sphere(2)
    options = {"charts": "atlas", "quantise": np.pi / 2}
    return coneflat.flatten(*mesh, **options), options, mesh


def test_a_sound_result_breaks_no_promise(ball):
    result, options, mesh = ball
    assert breaches_of(result, options, *mesh) == []


def planted(result, fault):
    """A result with a fault of one kind that it does not report."""
    uv = result.uv.copy()
    corner = {int(p): int(v) for p, v in zip(result.uv_faces.flat, result.faces.flat, strict=True)}
    copies = np.bincount(list(corner.values()))
    inner = next(p for p in corner if copies[corner[p]] == 1)
    on_seam = next(p for p in corner if copies[corner[p]] == 2)
    if fault == "not finite":
        uv[inner] = np.nan
    elif fault == "outside":
        uv[inner] += 2.0
    elif fault == "flipped":
        face = result.uv_faces[np.flatnonzero((result.uv_faces == inner).any(axis=1))[0]]
        uv[inner] += 2 * (uv[face[face != inner]].mean(axis=0) - uv[inner])
    elif fault == "moved a little":
        uv[on_seam] += 1e-4 * (uv[inner] - uv[on_seam])
    elif fault == "moved by a hair":
        uv[on_seam] += 1e-7 * (uv[inner] - uv[on_seam])
    elif fault == "other cone":
        return replace(result, curvatures=result.curvatures + np.eye(1, len(result.cones))[0])
    elif fault == "other vertices":
        return replace(result, vertices=result.vertices + 1e-9)
    elif fault == "turned":
        turn = np.exp(0.1j) * (uv @ [0.5, 0.5j]) + 0.2 + 0.1j
        first = np.zeros(len(uv), dtype=bool)
        first[result.uv_faces[:40]] = True
        corners = result.uv_faces.copy()
        corners[40:] += len(uv)
        uv = np.concatenate([np.column_stack([turn.real, turn.imag]), uv * 0.3 + 0.01])
        return replace(result, uv=uv, uv_faces=corners)
    return replace(result, uv=uv)


@pytest.mark.parametrize(
    ("fault", "cause"),
    [
        ("not finite", "arrays: uv not finite"),
        ("outside", "place: outside the texture"),
        ("flipped", "flipped: report differs"),
        ("flipped", "overlap: report differs"),
        ("moved a little", "curvature error understated"),
        ("moved by a hair", "sides of seams differ, exact"),
        ("other cone", "angle off by less than a full turn, exact"),
        ("other cone", "cones: sum of curvatures"),
        ("other vertices", "origin: vertices are not the input's"),
        ("turned", "rotations: report differs"),
        ("turned", "sides of seams differ, exact"),
    ],
)
def test_a_planted_fault_is_found(ball, fault, cause):
    result, options, mesh = ball
    assert cause in breaches_of(planted(result, fault), options, *mesh)


def test_a_lost_face_is_found(ball):
    result, options, (vertices, faces) = ball
    assert breaches_of(result, options, vertices, np.concatenate([faces, faces[5:6]])) == [
        "origin: a face of the input is lost"
    ]


def test_a_fault_that_its_own_note_names_is_no_breach(ball):
    result, options, mesh = ball
    turned, cause = planted(result, "flipped"), "flipped triangles, exact"
    for notes, is_breach in (
        ((), True),
        (
            (
                "2 cones with an angle that the surrounding triangles cannot form: vertex 3 (3 pi), vertex 5 (2 pi).",
            ),
            True,
        ),
        (("5 pairs of triangles overlap in the atlas, on 0.1 of the covered area.",), True),
        (("There is 1 flipped triangle in the plane: refine the mesh there.",), False),
    ):
        assert (cause in breaches_of(replace(turned, notes=notes), options, *mesh)) == is_breach
    different = replace(planted(result, "other cone"), notes=("The sum of curvatures is off at 1 cone.",))
    assert "cones: sum of curvatures" in breaches_of(different, options, *mesh)


def test_seams_differ_only_where_and_as_much_as_their_note_says(ball):
    result, options, mesh = ball
    is_moved = (planted(result, "moved by a hair").corner_uv != result.corner_uv).any(axis=2)
    moved_vertex = int(result.faces[is_moved][0])
    distant_vertex = int(np.argmax(np.linalg.norm(result.vertices - result.vertices[moved_vertex], axis=1)))
    room = (
        "1 triangle could not be untangled with matching seams, next to vertex {}: they are positively "
        "oriented, but the sides of seams near them are unequal."
    )
    unmatched = (
        "{} of 4 on the boundary or on marked seams could not keep their lengths, with relative errors of up to "
        "{}: the triangles there are too coarse for the curvature nearby."
    )
    marked = options | {"seams": result.seams}
    for fault, note, chosen, is_breach in (
        ("moved by a hair", room.format(moved_vertex), options, False),
        ("moved by a hair", room.format(f"{distant_vertex}, vertex {moved_vertex}"), options, False),
        ("moved by a hair", room.format(distant_vertex), options, True),
        ("moved a little", room.format(moved_vertex), options, True),
        ("moved by a hair", unmatched.format("2 edges", "1e-06"), marked, False),
        ("moved by a hair", unmatched.format("1 edge", "1e-06"), marked, True),
        ("moved by a hair", unmatched.format("2 edges", "1e-09"), marked, True),
        ("moved by a hair", unmatched.format("2 edges", "1e-06"), options, True),
    ):
        causes = breaches_of(replace(planted(result, fault), notes=(note,)), chosen, *mesh)
        assert any("sides of seams differ" in cause for cause in causes) == is_breach


def test_an_energy_above_the_bound_is_found(ball):
    layout = coneflat.unwrap(*ball[2])
    for bound, uv, is_found in (
        (4.1, layout.uv, False),
        (4.1, layout.uv * [1.0, 0.7], True),
        (4.01, layout.uv, True),
    ):
        outcome = Outcome("texture", 0)
        check_energy(outcome, replace(layout, uv=uv), bound)
        assert [cause for cause, _ in outcome.breaches] == ["energy above the bound"] * is_found


@pytest.mark.parametrize("ending", [".obj", ".ply", ".glb", ".npz"])
def test_a_file_of_another_layout_is_found(ball, tmp_path, ending):
    result = ball[0]
    path = result.save(tmp_path / f"ball{ending}")
    sound, different = Outcome("file", 0), Outcome("file", 0)
    check_file(sound, result, path)
    assert not sound.breaches
    check_file(different, replace(result, uv=0.99 * result.uv), path)
    assert any("another layout" in cause or "differently" in cause for cause, _ in different.breaches)


@pytest.mark.slow
def test_data_that_are_lost_without_a_note_are_found(monkeypatch):
    seeds = range(12)
    assert not any(run_case("attribute", seed).breaches for seed in seeds)
    monkeypatch.setattr("coneflat.io.write.losses", lambda *_: ())
    causes = [cause for seed in seeds for cause, _ in run_case("attribute", seed).breaches]
    assert any("lost without a note" in cause for cause in causes)


@pytest.mark.slow
def test_triangles_that_rounding_destroys_are_found(monkeypatch):
    seeds = range(24)
    assert not any(run_case("offset", seed).breaches for seed in seeds)
    monkeypatch.setattr("coneflat.io.gltf.positions.MAX_DISTANCE", np.inf)
    causes = [cause for seed in seeds for cause, _ in run_case("offset", seed).breaches]
    assert "offsets: .glb is another shape" in causes


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 8))
def test_no_case_is_a_breach(seed):
    outcome = run_case("grid", seed)
    assert not outcome.breaches


@pytest.fixture(scope="module")
def gridded():
    grid = integer_grid(*shapes.sphere(3), quads=60)
    return grid, find_quads(grid)


def causes(check, *arguments):
    outcome = Outcome("grid", 0)
    check(outcome, *arguments)
    return " ".join(cause for cause, _ in outcome.breaches)


def test_grids_that_break_promises_are_found(gridded):
    grid, _ = gridded
    assert causes(check_grid, grid, {}) == ""
    moved = grid.corner_grid.copy()
    moved[5, 1] += 1e-9
    assert "do not fit exactly" in causes(check_grid, replace(grid, corner_grid=moved), {})
    assert "cones beyond bounds" in causes(check_grid, grid, {"min_cone_angle": 2 * np.pi})
    turned = grid.corner_grid[:, ::-1]
    assert "flipped" in causes(check_grid, replace(grid, corner_grid=turned), {})
    assert "angles" in causes(check_grid, replace(grid, quarters=grid.quarters + 1), {})


def test_quads_that_break_promises_are_found(gridded):
    grid, mesh = gridded
    assert causes(check_quads, mesh, grid) == ""
    without = causes(check_quads, replace(mesh, quads=mesh.quads[1:]), grid)
    assert "Euler" in without
    assert "squares" in without
    turned = mesh.quads.copy()
    turned[3] = turned[3, ::-1]
    assert "same side" in causes(check_quads, replace(mesh, quads=turned), grid)
    off = mesh.vertices.copy()
    off[0] *= 1.001
    assert "off the surface" in causes(check_quads, replace(mesh, vertices=off), grid)
    folded = mesh.quads.copy()
    folded[2, 1] = folded[2, 0]
    assert "twice" in causes(check_quads, replace(mesh, quads=folded), grid)
