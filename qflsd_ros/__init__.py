"""Line segments from any camera, fisheye included, without a calibration (QF-LSD)."""
