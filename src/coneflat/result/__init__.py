"""What a flattening returns: put together, measured, held against what was promised."""
