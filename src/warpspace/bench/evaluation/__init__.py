"""What readings of several tests have in common: circles, reference lines, diagonals, layouts."""
