"""Image to arcs: the Steps 1 to 6 of the paper in order."""
