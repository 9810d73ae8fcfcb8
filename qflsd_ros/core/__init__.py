"""
The QF-LSD line detector, independent of ROS: it needs numpy, OpenCV and numba only.

Coordinates are px; (0, 0) is the centre of the top-left pixel, x points right, y down.

>>> import numpy as np
>>> from qflsd_ros.core import Detector
>>> gray = np.zeros((120, 160), np.uint8)
>>> gray[60:] = 200
>>> arcs = Detector().detect(gray)
>>> len(arcs)
1
"""
from qflsd_ros.core.arcs import Arcs
from qflsd_ros.core.attitude.estimation import Attitude, estimate_attitude
from qflsd_ros.core.attitude.tracker import AttitudeTracker
from qflsd_ros.core.detector import Detector
from qflsd_ros.core.lens.division import DivisionModel, rectified
from qflsd_ros.core.lens.estimation import estimate_distortion, LensEstimate
from qflsd_ros.core.lens.straightness import with_straightness
from qflsd_ros.core.parameters import Parameters
from qflsd_ros.core.tracking.tracker import Tracker

__all__ = ['Arcs', 'Attitude', 'AttitudeTracker', 'Detector', 'DivisionModel', 'LensEstimate',
           'Parameters', 'Tracker', 'estimate_attitude', 'estimate_distortion', 'rectified',
           'with_straightness']
