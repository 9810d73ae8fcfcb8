"""Output of the detector: the table of topics, publishers, and messages of arcs."""
