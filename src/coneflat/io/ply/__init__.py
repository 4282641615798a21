"""PLY files, text and binary: reading, which keeps polygons and all properties, and writing."""
