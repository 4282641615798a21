"""What is drawn of the pieces: outlines with allowances, notches, names."""
