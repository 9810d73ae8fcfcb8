"""Step 1: from a grey image to chains of edge points."""
