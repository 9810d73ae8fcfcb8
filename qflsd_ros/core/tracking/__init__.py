"""Lines over frames: each keeps its identity while the camera moves."""
