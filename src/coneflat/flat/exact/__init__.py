"""The exact method: a discretely conformal metric of given curvatures, found by Newton's method with edge flips."""
