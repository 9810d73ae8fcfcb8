"""The attitude of the camera: vanishing directions, up and the focal length, from arcs."""
