"""Angle based flattening: the flat metric whose angles are nearest to those wanted."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from .angle_conditions import AngleConditions, AngleStep, FoundAngles, excess_of, least_change

# Steps at most; what conditions may be off by in the end, radians and logs; and the largest change of an angle that
# another step would make: conditions are to hold exactly, while a minimum need not be found to the last digits.
STEPS, TOLERANCE, LAST_CHANGE = 100, 1e-9, 1e-6
# Part of the objective's own second derivative that is kept at least, so that each step has a minimum.
CONVEX = 0.1
# How much of the way to 0 or pi a step may take an angle; by how much the weight of one grows that would go farther.
PART, HEAVIER = 0.5, 2.0


def nearest_angles(conditions: AngleConditions, wanted: FloatArray) -> FoundAngles:
    """Return the angles of a flat metric whose differences from those wanted have the least sum of relative squares.

    ABF++ (A. Sheffer, B. Levy, M. Mogilnitsky, A. Bogomyakov, "ABF++: fast and robust angle based flattening", 2005):
    Newton's method for sum w (x - wanted)^2 / 2, w = 1 / wanted^2, with Lagrange multipliers, each system reduced to
    the multipliers of vertices. Products of sines are taken by their logs here: that makes the second derivative of
    the Lagrangian diagonal with nothing neglected, and convergence quadratic where it stays positive.

    A step that would take angles more than half way to 0 or pi is shortened to that, and their weights grow.

    Args:
        conditions: to be fulfilled.
        wanted: (3m,) radians, positive and less than pi.
    """
    angles, weights = wanted.copy(), wanted**-2
    sums = len(conditions.totals)
    forces = np.zeros(sums + conditions.ratios.shape[0])
    residual, change = conditions.residual(angles), np.inf
    step: AngleStep | None = None
    for count in range(STEPS + 1):
        bend = -(conditions.ratios.T @ forces[sums:]) / np.sin(angles) ** 2
        step = least_change(
            conditions.slopes(angles),
            conditions.off(angles),
            excess_of(angles),
            np.maximum(weights + bend, CONVEX * weights),
            weights * (angles - wanted),
            step,
        )
        change = float(np.abs(step.change).max())
        converged = residual <= TOLERANCE and change <= LAST_CHANGE
        if converged or count == STEPS or not np.isfinite(change):
            break
        room = PART * np.where(step.change < 0, angles, np.pi - angles)
        goes_far = np.abs(step.change) > room
        part = float((room[goes_far] / np.abs(step.change[goes_far])).min(initial=1.0))
        weights[goes_far] *= HEAVIER
        angles += part * step.change
        forces += part * (step.forces - forces)
        residual = conditions.residual(angles)
    return FoundAngles(angles, count, converged, residual)
