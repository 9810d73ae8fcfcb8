"""The stages from a grey image to its arcs."""
