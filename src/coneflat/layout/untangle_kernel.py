"""The energy by which triangles are turned over, and its derivatives, compiled.

The map of a triangle is z -> a z + b conj(z), its determinant det = |a|^2 - |b|^2, its squared norm 2 (|a|^2 + |b|^2).
The energy is (|a|^2 + |b|^2 + (1 + det^2) / 2) / p with p = (det + root) / 2 and root = hypot(epsilon, det): finite
where det is negative, and the larger the smaller epsilon is there.

Its Hessian by (Re a, Im a, Re b, Im b) splits: turning a or b alone are eigenvectors, and what lengthens a or b is
a block of two by two. So its positive part has a closed form.
"""

from __future__ import annotations

import math

from .._arrays import ComplexArray, FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def fill_energies(a: ComplexArray, b: ComplexArray, epsilon: FloatArray, energies: FloatArray) -> None:
    """Fill the energy of each triangle."""
    for f in range(len(a)):
        norm = a[f].real ** 2 + a[f].imag ** 2
        other = b[f].real ** 2 + b[f].imag ** 2
        det = norm - other
        root = math.hypot(epsilon[f], det)
        # p without cancellation where det is negative
        p = (det + root) / 2 if det > 0 else epsilon[f] ** 2 / (2 * (root - det))
        energies[f] = (norm + other + (1 + det**2) / 2) / p


@compiled
def add_derivatives(
    a: ComplexArray,
    b: ComplexArray,
    epsilon: FloatArray,
    a_of: ComplexArray,
    b_of: ComplexArray,
    corners: IntArray,
    slots: IntArray,
    gradient: FloatArray,
    values: FloatArray,
) -> None:
    """Add up the gradient by the shifts of vertices, and the positive part of each triangle's Hessian.

    Args:
        a, b: (f,) the maps. epsilon: (f,).
        a_of, b_of: (f, 3) their derivatives by the shift of each corner, as complex factors.
        corners: (f, 3) the vertex that is shifted with a corner, -1 for none.
        slots: (f, 3, 3) the block of the matrix for each pair of corners.
        gradient: (2k,) by the real and the imaginary part of the shift of each vertex in turn.
        values: (4 blocks,) the entries of the blocks, which are two by two, row by row.
    """
    for f in range(len(a)):
        one, two = abs(a[f]), abs(b[f])
        det = one**2 - two**2
        root = math.hypot(epsilon[f], det)
        p = (det + root) / 2 if det > 0 else epsilon[f] ** 2 / (2 * (root - det))
        energy = (one**2 + two**2 + (1 + det**2) / 2) / p
        by_norm, by_det = 1 / p, det / p - energy / root
        mixed = -1 / (p * root)
        twice = 1 / p - det / (p * root) - by_det / root + energy * det / root**3
        along_a = a[f] / one if one > 0 else 1.0 + 0.0j
        along_b = b[f] / two if two > 0 else 1.0 + 0.0j
        slope_a, slope_b = 2 * (by_norm + by_det), 2 * (by_norm - by_det)
        # The block of the lengths of a and b, and its positive part.
        first = slope_a + 8 * mixed * one**2 + 4 * twice * one**2
        last = slope_b - 8 * mixed * two**2 + 4 * twice * two**2
        cross = -4 * twice * one * two
        middle, half = (first + last) / 2, (first - last) / 2
        radius = math.hypot(half, cross)
        high, low = max(middle + radius, 0.0), max(middle - radius, 0.0)
        if radius > 0:
            first = (high + low) / 2 + (high - low) / 2 * half / radius
            last = (high + low) / 2 - (high - low) / 2 * half / radius
            cross = (high - low) / 2 * cross / radius
        else:
            first = last = high
            cross = 0.0
        turn_a, turn_b = max(slope_a, 0.0), max(slope_b, 0.0)
        for i in range(3):
            v = corners[f, i]
            if v < 0:
                continue
            # Shifts by 1 and by 1j change a and b by these parts along themselves and across.
            p_i, q_i = a_of[f, i] * along_a.conjugate(), b_of[f, i] * along_b.conjugate()
            gradient[2 * v] += slope_a * one * p_i.real + slope_b * two * q_i.real
            gradient[2 * v + 1] -= slope_a * one * p_i.imag + slope_b * two * q_i.imag
            for j in range(3):
                if corners[f, j] < 0:
                    continue
                p_j, q_j = a_of[f, j] * along_a.conjugate(), b_of[f, j] * along_b.conjugate()
                place = 4 * slots[f, i, j]
                for s in range(2):
                    x, y = (p_i.real, p_i.imag) if s == 0 else (-p_i.imag, p_i.real)
                    z, w = (q_i.real, q_i.imag) if s == 0 else (-q_i.imag, q_i.real)
                    for t in range(2):
                        x2, y2 = (p_j.real, p_j.imag) if t == 0 else (-p_j.imag, p_j.real)
                        z2, w2 = (q_j.real, q_j.imag) if t == 0 else (-q_j.imag, q_j.real)
                        values[place + 2 * s + t] += (
                            first * x * x2
                            + last * z * z2
                            + cross * (x * z2 + z * x2)
                            + turn_a * y * y2
                            + turn_b * w * w2
                        )
