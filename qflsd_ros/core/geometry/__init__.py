"""What arcs say about space."""
