"""Lenses: their models, and their estimation from arcs."""
