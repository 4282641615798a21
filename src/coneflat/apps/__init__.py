"""What is made of the package: the command line, batches, comparisons, the studio."""
