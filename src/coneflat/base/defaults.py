"""Defaults and bounds that the options and the stages share."""

from __future__ import annotations

import math

#: The allowed area distortion E.
DISTORTION = 0.2
#: Smallest and largest cone angle, radians.
MIN_CONE_ANGLE = math.pi / 2
MAX_CONE_ANGLE = 4 * math.pi
#: Maximum number of cones of a cone curve.
MAX_CONES = 30
#: Texels along a side of a texture, and texels between charts.
RESOLUTION = 1024
PADDING = 2.0
#: Texels along a side of a baked texture.
BAKED_RESOLUTION = 2048
#: Checkerboard cells along the square root of the area: about 20 across a ball.
CHECKER_CELLS = 36
#: Resolution of figures.
DOTS_PER_INCH = 300.0
# A preference of 1 makes seams at hidden places ten times cheaper. With a factor above 1e10, the lengths of seams
# would be smaller than the rounding errors of their costs.
MAX_PREFERENCE = 10.0
# Error of a number that is typed with seven digits: radians, or relative.
TYPED_TOLERANCE = 1e-6
# Smallest quantum, radians. Multiples are known to 1e-6, so a smaller quantum would restrict nothing measurable.
MIN_QUANTUM = 1e-4
