"""Integer grids on surfaces, and the quad meshes that they are."""
