"""Geometry in space from arcs: planes of edges, vanishing directions, attitude."""
