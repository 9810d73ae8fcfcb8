"""The motion of the image, which predicts where tracks are in the next frame."""
