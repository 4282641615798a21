"""Unwrapping for textures: the shortest seams for which a layout with free seams is nearly isometric."""
