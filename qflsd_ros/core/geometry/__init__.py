"""Lines in space from arcs: planes of edges, triangulation, a map, stereo."""
