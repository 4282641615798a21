"""Applications of the package: the command line, batches, quads, comparisons, the viewer and the studio."""
