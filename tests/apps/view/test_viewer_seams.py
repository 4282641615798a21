"""Whole seams in the viewer: which edges they have, and how they are shown."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from browsing import thing
from chromium import browser_path
from flat_pieces import gores, two_pieces, with_dart

import coneflat
from coneflat.apps.patterns.page import as_flattening
from coneflat.apps.view.page.content import content_of
from coneflat.mesh import end_corners

RING = 18  # Pixels; the ring around a short edge, with its halo, is smaller.
needs_browser = pytest.mark.skipif(browser_path() is None, reason="there is no Chromium here")


def sides_of(content):
    """The points at the start and at the end of both sides of each seam edge."""
    points = content.faces.reshape(-1)
    return [points[end].reshape(-1, 2) for end in end_corners(content.outline[: 2 * content.seams])]


@pytest.mark.parametrize("shape", [shapes.torus, shapes.tetrahedron, lambda: shapes.sphere(3)])
def test_both_sides_of_a_seam_are_unbroken(shape):
    """The edges of a seam form one path on either side, and no seam goes on in another one."""
    content = content_of(coneflat.flatten(*shape()), 10**6)
    start, end = sides_of(content)
    numbers = content.seam_numbers
    assert np.array_equal(
        np.unique(numbers, return_index=True)[1], np.sort(np.unique(numbers, return_index=True)[1])
    )
    meetings = {}
    for edge, seam in enumerate(numbers.tolist()):
        for pair in ((start[edge, 0], end[edge, 1]), (end[edge, 0], start[edge, 1])):
            meetings.setdefault(tuple(sorted(pair)), []).append((edge, seam))
    for edges in meetings.values():
        assert len(edges) <= 2
        assert len({seam for _, seam in edges}) == 1
    for seam in range(numbers.max() + 1):
        ends = [edges for edges in meetings.values() if len(edges) == 1 and edges[0][1] == seam]
        inner = sum(len(edges) == 2 and edges[0][1] == seam for edges in meetings.values())
        count = int((numbers == seam).sum())
        assert (len(ends), inner) in ((2, count - 1), (0, count))


def test_a_tetrahedron_has_three_seams():
    """They meet at one of its corners, or follow each other; where they follow each other, the middle ones do not."""
    result = coneflat.flatten(*shapes.tetrahedron())
    content = content_of(result, 10**6)
    assert content.seams == 3
    assert content.seam_numbers.max() + 1 == 3


@pytest.mark.parametrize("pattern", [two_pieces(), with_dart(), gores(5)], ids=["pieces", "dart", "gores"])
def test_seams_are_those_of_a_pattern(pattern):
    content = content_of(as_flattening(pattern), 10**6)
    of_pattern = np.full(len(pattern.surface.mesh.edges), -1)
    for number, seam in enumerate(pattern.seams):
        of_pattern[pattern.surface.mesh.halfedge_edges[seam.sides[0].halfedges]] = number
    pairs = set(zip(content.seam_numbers.tolist(), of_pattern[pattern.surface.seams].tolist(), strict=True))
    assert len(pairs) == len(pattern.seams) == len({first for first, _ in pairs})


def share_of_accent(visit, pane, places, hovered=None):
    """How many places have the colour of marks; those at the ring around the hovered edge do not count."""
    box, picture = visit.box(pane), visit.picture(pane)
    is_accent = np.pad(np.abs(picture - [0xD6, 0x00, 0x6C]).max(axis=2) < 60, 2)
    places = np.array(places)
    if hovered is not None:
        rings = np.array(visit.at(pane, thing("seam", hovered)))
        places = places[np.linalg.norm(places[:, None] - rings, axis=2).min(axis=1) > RING]
    columns, rows = np.floor(places - [box["x"], box["y"]]).astype(int).T + 2
    around = [is_accent[rows + down, columns + right] for down in (-1, 0, 1) for right in (-1, 0, 1)]
    return np.any(around, axis=0).mean()


@needs_browser
def test_pointing_at_a_seam_shows_its_partner(visit, viewed):
    """All edges of the seam are marked, on both sides in the layout and on the model where they are visible."""
    visit.run("coneflat.state.set({show: 'plain', cones: false})")
    numbers = content_of(viewed, 10**6).seam_numbers
    for seam in range(numbers.max() + 1):
        edges = np.flatnonzero(numbers == seam)
        if len(edges) < 8:
            continue
        first = int(edges[len(edges) // 2])
        x, y = visit.at("layout", thing("seam", first))[0]
        visit.page.mouse.move(x, y)
        hovered = visit.state("hovered")
        assert hovered["kind"] == "seam"
        seen = numbers == numbers[hovered["index"]]
        distant = [int(edge) for edge in np.flatnonzero(seen) if edge != hovered["index"]]
        sides = list(zip(*(visit.at("layout", thing("seam", edge)) for edge in distant), strict=True))
        assert len(sides) == 2
        assert all(share_of_accent(visit, "layout", side, hovered["index"]) > 0.9 for side in sides)
        visible = [
            edge for edge in distant
            if visit.run(f"coneflat.marks.isSeen(coneflat.panes[0], {thing('seam', edge)}, coneflat.state)")
        ]  # fmt: skip
        places = [visit.at("model", thing("seam", edge))[0] for edge in visible]
        assert not places or share_of_accent(visit, "model", places, hovered["index"]) > 0.6
        assert f"a seam of {seen.sum()} edges" in visit.page.inner_text("#facts")
    visit.page.mouse.move(5, 5)
    everywhere = [visit.at("layout", thing("seam", edge))[0] for edge in range(len(numbers))]
    assert share_of_accent(visit, "layout", everywhere) == 0


@needs_browser
def test_a_key_visits_all_seams(visit, viewed):
    numbers = content_of(viewed, 10**6).seam_numbers
    visited = []
    for _ in range(numbers.max() + 2):
        visit.page.keyboard.press("h")
        picked = visit.state("picked")
        assert picked["kind"] == "seam"
        visited.append(int(numbers[picked["index"]]))
        assert "Seam edge" in visit.page.inner_text("#facts")
    assert visited == [*range(numbers.max() + 1), 0]
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") is None
