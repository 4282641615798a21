"""Integer grids: layouts whose grid lines close up on the surface, and the quads that they are."""
