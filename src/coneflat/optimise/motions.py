"""Motions of the points of a layout as functions of unknowns, such that seams stay rigid and constraints hold.

The shifts of points are eliminated in two steps, each a product with a sparse matrix. First they are written as sums of
real numbers, here called sources: the shifts of free points, and coupled ones, which several points share. The coupled
sources satisfy linear equations. In the second step they are replaced by the solutions of these equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import ComplexArray, FloatArray, IntArray, mask_of
from ..errors import OptionError
from ..geometry.planar import as_complex
from ..linalg.elimination import RELATIVE_ROUNDING, solutions_of
from .restrictions import CheckedConstraints, Restrictions, SeamChains

# Unit of the rounding gaps between the sides of seams. In this unit they are large enough not to be treated as zero.
CLOSING_UNIT = 2.0**-40
# Kinds of points: those that do not move; those that move freely, along a line, or to a place; the second points of
# vertices within seams, which follow the first; and joints, whose shifts are coupled to those of others by equations.
FIXED, FREE, ON_LINE, PINNED, FOLLOWER, JOINT = range(6)


@dataclass(frozen=True, eq=False)
class Motions:
    """The shifts of points as linear functions of real unknowns.

    Attributes:
        matrix: (u, k + 1) the complex shift of each point per unit of each unknown. Unknown k, the offset, is not
            solved for: with the value 1 it moves the points to where the constraints hold.
    """

    matrix: csr_matrix

    @property
    def count(self) -> int:
        """The number k of unknowns, without the offset."""
        return int(self.matrix.shape[1]) - 1

    @property
    def has_offset(self) -> bool:
        """Whether the offset moves a point: constraints do not hold at the current points."""
        return bool(np.any(self.matrix.data[self.matrix.indices == self.count] != 0))

    def shifts(self, step: FloatArray) -> ComplexArray:
        """Return (u,) the complex shifts of the points for a step (k + 1,) of the unknowns and the offset."""
        return np.asarray(self.matrix @ step)


@dataclass(frozen=True, eq=False)
class Sources:
    """The real numbers on which shifts depend: coupled ones, those of single points, and the constant 1, in this order.

    Attributes:
        coupled: number of coupled sources: two for each joint and each changing translation of a seam, one for each
            line that moves sideways.
        constant: index of the constant, the last one.
        of_point: (u,) the first source of each point: free points and joints have two, the coordinates of the shift,
            points on lines have one, others none, which is -1.
        of_chain: (c,) the first of two sources of each seam's translation; -1 if it is fixed.
        of_line: (l,) the source of each line; -1 if it is fixed.
    """

    coupled: int
    constant: int
    of_point: IntArray
    of_chain: IntArray
    of_line: IntArray


class Equations(NamedTuple):
    """Linear equations between coupled sources: matrix entries by row, source and factor; and right-hand sides (r,)."""

    row: IntArray
    source: IntArray
    factor: FloatArray
    right: FloatArray


class Entries(NamedTuple):
    """Entries of a matrix of shifts: the shift of a point per unit of a source."""

    point: IntArray
    source: IntArray
    shift: ComplexArray


def find_motions(points: ComplexArray, restrictions: Restrictions) -> Motions:
    """Return the motions of points (u,) that preserve the rotation across every seam and satisfy constraints.

    Raises:
        OptionError: the constraints contradict each other.

    Notes:
        The second point of a vertex within a seam has the shift of the first, rotated by the rotation of the seam, plus
        the change of the seam's translation. At the ends of seams the same holds for the shifts of joints, as
        equations: several seams meet there.
    """
    gaps = np.zeros(restrictions.chains.left.shape, dtype=np.complex128)
    motions, residual, size = _motions_and_residual(points, restrictions, gaps)
    # The rotations of seams are exact up to rounding, and points are many units from their centres.
    if residual > 100 * RELATIVE_ROUNDING * max(1.0, size):
        raise OptionError(f"constraints contradict each other, or the seams, by about {residual:.2g}")
    return motions


def close_seams(points: ComplexArray, restrictions: Restrictions) -> ComplexArray:
    """Return (u,) moved points with the rounding gaps between the sides of seams closed.

    If a layout shrinks by a factor of a thousand, the relative size of rounding errors grows by the same factor.
    """
    chains = restrictions.chains
    if not len(chains.edges):
        return points
    images = chains.rotation[chains.chain, None] * points[chains.left]
    images += mean_translations(points, chains)[chains.chain, None]
    # The gaps between fixed points remain, so the equations may be inconsistent by rounding.
    gaps = (images - points[chains.right]) / CLOSING_UNIT
    motions, _, _ = _motions_and_residual(points, restrictions, gaps)
    offset = np.zeros(motions.count + 1)
    offset[-1] = CLOSING_UNIT
    return points + motions.shifts(offset)


def _motions_and_residual(
    points: ComplexArray, restrictions: Restrictions, gaps: ComplexArray
) -> tuple[Motions, float, float]:
    """Return motions that close gaps, and the residual and the largest right-hand side of the equations.

    gaps: (k, 2) for the ends of seam edges, the shift of the right point that is needed in addition.
    """
    kind = point_kinds(restrictions)
    sources = number_sources(kind, restrictions)
    constraints = restrictions.constraints
    distances = line_distances(points, constraints)
    rows, right = stack_equations(
        [
            joint_equations(kind, sources, restrictions, gaps),
            pin_equations(kind, sources, points, constraints),
            tie_equations(sources, mean_translations(points, restrictions.chains), restrictions),
            line_equations(kind, sources, distances, constraints),
        ],
        sources.coupled,
    )
    solutions, residuals = solutions_of(rows, right)
    leaders = stack_entries(
        [
            free_shifts(kind, sources),
            line_shifts(kind, sources, distances, constraints),
            pinned_shifts(kind, sources, points, constraints),
        ],
        sources,
    )
    matrix = with_followers(leaders, kind, sources, restrictions.chains, gaps) @ expansion(solutions, sources)
    residual, size = (float(np.abs(values).max(initial=0.0)) for values in (residuals, right))
    return Motions(matrix), residual, size


def point_kinds(restrictions: Restrictions) -> IntArray:
    """Return (u,) the kind of each point."""
    chains, constraints, is_free = restrictions.chains, restrictions.constraints, restrictions.is_free
    kind = np.where(is_free, FREE, FIXED)
    kind[constraints.pinned] = PINNED
    kind[constraints.on_line] = ON_LINE
    kind[chains.right] = FOLLOWER
    is_at_node = mask_of(len(kind), np.concatenate([chains.left, chains.right]))
    is_at_node &= chains.is_node[restrictions.vertex]
    constrained, times = np.unique(
        np.concatenate([constraints.pinned, constraints.on_line]), return_counts=True
    )
    kind[is_at_node] = kind[constrained[times > 1]] = JOINT
    return np.where(is_free, kind, FIXED)


def number_sources(kind: IntArray, restrictions: Restrictions) -> Sources:
    """Return the numbers of the sources."""
    chains = restrictions.chains
    joints = np.flatnonzero(kind == JOINT)
    is_stuck = ~restrictions.is_free[chains.left] & ~chains.is_node[chains.vertices]
    loose_chains = np.flatnonzero(np.bincount(chains.chain, is_stuck.any(axis=1), len(chains.rotation)) == 0)
    loose_lines = np.flatnonzero(np.isnan(restrictions.constraints.offsets))
    of_point, of_chain = np.full(len(kind), -1), np.full(len(chains.rotation), -1)
    of_line = np.full(len(restrictions.constraints.directions), -1)
    of_point[joints] = 2 * np.arange(len(joints))
    of_chain[loose_chains] = 2 * (len(joints) + np.arange(len(loose_chains)))
    of_line[loose_lines] = 2 * (len(joints) + len(loose_chains)) + np.arange(len(loose_lines))
    coupled = 2 * (len(joints) + len(loose_chains)) + len(loose_lines)
    moving = np.flatnonzero((kind == FREE) | (kind == ON_LINE))
    ends = coupled + np.cumsum(np.where(kind[moving] == FREE, 2, 1))
    of_point[moving[:1]], of_point[moving[1:]] = coupled, ends[:-1]
    constant = int(ends[-1]) if len(ends) else coupled
    return Sources(coupled, constant, of_point, of_chain, of_line)


def mean_translations(points: ComplexArray, chains: SeamChains) -> ComplexArray:
    """Return (c,) the mean translation of each chain from its rotated left side to its right side."""
    translations = points[chains.right] - chains.rotation[chains.chain, None] * points[chains.left]
    total = np.zeros(len(chains.rotation), dtype=np.complex128)
    np.add.at(total, chains.chain, translations.mean(axis=1))
    return total / np.bincount(chains.chain, minlength=len(total))


def line_distances(points: ComplexArray, constraints: CheckedConstraints) -> FloatArray:
    """Return (q,) the signed distance of each point on a line to it, positive to the left of its direction.

    A line that may move sideways passes through its first point.
    """
    line, offsets = constraints.line, constraints.offsets.copy()
    across = (np.conj(_normals(constraints)[line]) * points[constraints.on_line]).real
    lines, first = np.unique(line, return_index=True)
    is_loose = np.isnan(offsets[lines])
    offsets[lines[is_loose]] = across[first[is_loose]]
    return offsets[line] - across


def _normals(constraints: CheckedConstraints) -> ComplexArray:
    """Return (l,) the unit normals of lines, to the left of their directions."""
    return 1j * as_complex(constraints.directions)


def stack_equations(parts: list[Equations], width: int) -> tuple[csr_matrix, FloatArray]:
    """Return the matrix (r, width) and the right-hand sides (r,) of all equations."""
    sizes = np.cumsum([0, *(len(part.right) for part in parts)])
    row = np.concatenate([part.row + start for part, start in zip(parts, sizes, strict=False)])
    source, factor, right = (np.concatenate(arrays) for arrays in list(zip(*parts, strict=True))[1:])
    matrix = csr_matrix((factor, (row, source)), shape=(int(sizes[-1]), width))
    matrix.eliminate_zeros()
    return matrix, right


def complex_equations(sources: IntArray, factors: ComplexArray, right: ComplexArray) -> Equations:
    """Return two real equations for each complex one, in which sums of factors times sources have given values.

    Args:
        sources: (q, t) the first of the two sources of each complex number; -1 for none.
        factors: (q, t) complex factors.
        right: (q,) complex values.
    """
    equation, term = np.nonzero(sources >= 0)
    source, factor = sources[equation, term], factors[equation, term]
    return Equations(
        np.concatenate([2 * equation, 2 * equation, 2 * equation + 1, 2 * equation + 1]),
        np.concatenate([source, source + 1, source, source + 1]),
        np.concatenate([factor.real, -factor.imag, factor.imag, factor.real]),
        np.stack([right.real, right.imag], axis=1).ravel(),
    )


def joint_equations(
    kind: IntArray, sources: Sources, restrictions: Restrictions, gaps: ComplexArray
) -> Equations:
    """Return that seams map the shifts of their left points at nodes to those of the right ones, up to gaps."""
    chains = restrictions.chains
    edge, end = np.nonzero(chains.is_node[chains.vertices])
    chain, left, right = chains.chain[edge], chains.left[edge, end], chains.right[edge, end]
    of_joint = np.where(kind == JOINT, sources.of_point, -1)
    terms = np.stack([of_joint[right], of_joint[left], sources.of_chain[chain]], axis=1)
    factors = np.stack([np.ones(len(chain)), -chains.rotation[chain], -np.ones(len(chain))], axis=1)
    moves = (terms >= 0).any(axis=1)
    return complex_equations(terms[moves], factors[moves], gaps[edge, end][moves])


def pin_equations(
    kind: IntArray, sources: Sources, points: ComplexArray, constraints: CheckedConstraints
) -> Equations:
    """Return that pinned joints get their places."""
    is_joint = kind[constraints.pinned] == JOINT
    pinned = constraints.pinned[is_joint]
    shifts = as_complex(constraints.places[is_joint]) - points[pinned]
    return complex_equations(
        sources.of_point[pinned, None], np.ones((len(pinned), 1), dtype=np.complex128), shifts
    )


def tie_equations(sources: Sources, translations: ComplexArray, restrictions: Restrictions) -> Equations:
    """Return that tied seams get their translations.

    Raises:
        OptionError: a tied half-edge is on no seam, or on one whose translation is fixed.
    """
    chains, constraints = restrictions.chains, restrictions.constraints
    terms, changes = [], []
    for halfedge, target in zip(
        constraints.tied.tolist(), as_complex(constraints.translations).tolist(), strict=True
    ):
        at = np.argwhere(chains.halfedges == halfedge)
        if not len(at):
            raise OptionError(f"tied half-edge {halfedge} is on no seam")
        edge, is_right = at[0].tolist()
        chain = int(chains.chain[edge])
        if sources.of_chain[chain] < 0:
            raise OptionError(f"tied half-edge {halfedge} is on a seam with a fixed translation")
        terms.append(sources.of_chain[chain])
        translation = target if is_right else -complex(chains.rotation[chain]) * target
        changes.append(translation - complex(translations[chain]))
    return complex_equations(
        np.array(terms, dtype=np.int64).reshape(-1, 1),
        np.ones((len(terms), 1), dtype=np.complex128),
        np.array(changes, dtype=np.complex128),
    )


def line_equations(
    kind: IntArray, sources: Sources, distances: FloatArray, constraints: CheckedConstraints
) -> Equations:
    """Return that joints on lines reach them: their shift across the line is the distance and the line's shift."""
    at_joint = np.flatnonzero(kind[constraints.on_line] == JOINT)
    line, point = constraints.line[at_joint], constraints.on_line[at_joint]
    normal, row = _normals(constraints)[line], np.arange(len(at_joint))
    is_loose = sources.of_line[line] >= 0
    return Equations(
        np.concatenate([row, row, row[is_loose]]),
        np.concatenate(
            [sources.of_point[point], sources.of_point[point] + 1, sources.of_line[line[is_loose]]]
        ),
        np.concatenate([normal.real, normal.imag, -np.ones(int(is_loose.sum()))]),
        distances[at_joint],
    )


def stack_entries(parts: list[Entries], sources: Sources) -> csr_matrix:
    """Return the (u, s + 1) matrix of the shifts of all points; entries of the constant that are zero are left out."""
    point, source, shift = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    stays = (source < sources.constant) | (shift != 0)
    return csr_matrix(
        (shift[stays], (point[stays], source[stays])), shape=(len(sources.of_point), sources.constant + 1)
    )


def complex_entries(points: IntArray, first: IntArray) -> Entries:
    """Return the shifts of points (q,) by complex numbers, each given by the first of its two sources (q,)."""
    ones = np.ones(len(points), dtype=np.complex128)
    return Entries(
        np.concatenate([points, points]),
        np.concatenate([first, first + 1]),
        np.concatenate([ones, 1j * ones]),
    )


def free_shifts(kind: IntArray, sources: Sources) -> Entries:
    """Return the shifts of free points and joints."""
    points = np.flatnonzero((kind == FREE) | (kind == JOINT))
    return complex_entries(points, sources.of_point[points])


def line_shifts(
    kind: IntArray, sources: Sources, distances: FloatArray, constraints: CheckedConstraints
) -> Entries:
    """Return the shifts of points on lines: along the line, with it sideways, and onto it."""
    at = np.flatnonzero(kind[constraints.on_line] == ON_LINE)
    points, line = constraints.on_line[at], constraints.line[at]
    normal = _normals(constraints)[line]
    is_loose = sources.of_line[line] >= 0
    return Entries(
        np.concatenate([points, points[is_loose], points]),
        np.concatenate(
            [
                sources.of_point[points],
                sources.of_line[line[is_loose]],
                np.full(len(points), sources.constant),
            ]
        ),
        np.concatenate([-1j * normal, normal[is_loose], normal * distances[at]]),
    )


def pinned_shifts(
    kind: IntArray, sources: Sources, points: ComplexArray, constraints: CheckedConstraints
) -> Entries:
    """Return the shifts of pinned points to their places."""
    at = np.flatnonzero(kind[constraints.pinned] == PINNED)
    pinned = constraints.pinned[at]
    shifts = as_complex(constraints.places[at]) - points[pinned]
    return Entries(pinned, np.full(len(pinned), sources.constant), shifts)


def with_followers(
    leaders: csr_matrix, kind: IntArray, sources: Sources, chains: SeamChains, gaps: ComplexArray
) -> csr_matrix:
    """Return the (u, s + 1) shifts of all points, from those of all but followers.

    A follower has the shift of its leader, the left point of the vertex within a seam, rotated by the rotation of the
    seam, plus the change of the seam's translation, and the gap.
    """
    edge, end = np.nonzero(kind[chains.right] == FOLLOWER)
    if not len(edge):
        return leaders
    followers, first = np.unique(chains.right[edge, end], return_index=True)
    edge, end = edge[first], end[first]
    chain = chains.chain[edge]
    count = len(kind)
    copies = csr_matrix((chains.rotation[chain], (followers, chains.left[edge, end])), shape=(count, count))
    is_loose = sources.of_chain[chain] >= 0
    translations = complex_entries(followers[is_loose], sources.of_chain[chain[is_loose]])
    closings = Entries(followers, np.full(len(followers), sources.constant), gaps[edge, end])
    return leaders + copies @ leaders + stack_entries([translations, closings], sources)


def expansion(solutions: csr_matrix, sources: Sources) -> csr_matrix:
    """Return the (s + 1, k + 1) matrix from unknowns to sources: the solutions of equations, and further sources.

    solutions: (v, b + 1) a basis of the values of coupled sources, and their values at the offset in the last column.
    """
    coupled = solutions.tocoo()
    dimension = solutions.shape[1] - 1
    further = np.arange(sources.coupled, sources.constant + 1)
    count = dimension + len(further) - 1
    return csr_matrix(
        (
            np.concatenate([coupled.data, np.ones(len(further))]),
            (
                np.concatenate([coupled.row, further]),
                np.concatenate(
                    [
                        np.where(coupled.col == dimension, count, coupled.col),
                        further - sources.coupled + dimension,
                    ]
                ),
            ),
        ),
        shape=(sources.constant + 1, count + 1),
    )
