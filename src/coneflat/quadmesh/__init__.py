"""Integer-grid maps and the quad meshes extracted from them."""
