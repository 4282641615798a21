"""How cones are found, one file per strategy: a function of a surface and its specification."""
