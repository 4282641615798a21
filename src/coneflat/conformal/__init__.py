"""From target curvature to a flat metric: a file per method."""
