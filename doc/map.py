"""Draw ``map.jpg``, the map of the lines of the room, beside this file: python3 doc/map.py."""
from __future__ import annotations

from pathlib import Path

import cv2
from qflsd_ros.core import Tracker
from qflsd_ros.core.geometry.line_map import LineMap
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens.camera_model import CameraModel
from qflsd_ros.core.pose import Pose
from qflsd_ros.map_drawing import draw_map
from qflsd_ros.sources import Scene
from qflsd_ros.sources.scene.optics import calibration

FRAMES = 1200       # once around the room
SCALE = 0.62         # of the picture, for a README
QUALITY = 75        # of JPEG: below 100 kB

scene, tracker, world = Scene(lam=-0.5, noise=2.0), Tracker(), LineMap()
terms = calibration(scene.lens)
camera = CameraModel(terms.distortion_model, terms.matrix, terms.coefficients)
for number in range(FRAMES):
    arcs = tracker.track(scene.image(number), lens=scene.lens)
    seen = planes(arcs, camera)
    world.add(arcs.table['track'][seen.arcs], seen, Pose.from_matrix(scene.pose(number)))
mapped = world.lines()
picture = draw_map(mapped.tracks, mapped.lines.ends, scene.edges)
small = cv2.resize(picture, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA)
cv2.imwrite(str(Path(__file__).with_name('map.jpg')), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
