"""Defaults and bounds of options that stages have, too, each written once."""

from __future__ import annotations

import math

#: The area distortion allowed.
DISTORTION = 0.2
#: Radians of the sharpest cone, and of the widest saddle.
MIN_CONE_ANGLE = math.pi / 2
MAX_CONE_ANGLE = 4 * math.pi
#: Cones at most, of a curve.
MOST_CONES = 30
#: Texels along a side of a texture, and between charts.
RESOLUTION = 1024
PADDING = 2.0
# A preference for hidden places of 1 makes seams ten times cheaper; with a factor of more than 1e10, the
# lengths of seams are beneath the rounding of their costs.
MOST_PREFERENCE = 10.0
# Radians, or shares, by which a number typed with seven digits is off.
TYPED_TOLERANCE = 1e-6
# Radians: finer quanta than this restrict nothing that could be told from none, as multiples are known to 1e-6.
LEAST_QUANTUM = 1e-4
