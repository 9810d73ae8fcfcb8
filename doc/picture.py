"""Draw ``room.jpg``, the picture of the README, beside this file: python3 doc/picture.py."""
from __future__ import annotations

from pathlib import Path

import cv2
from qflsd_ros.core import Detector
from qflsd_ros.overlay import draw
from qflsd_ros.sources import Scene

FRAME = 400  # shows the window, a chessboard, the rug and the beams of the ceiling

image = Scene(960, 720, lam=-0.4, colour=True).image(FRAME)
arcs = Detector().detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
picture = cv2.imencode('.jpg', draw(image, arcs, 2), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
Path(__file__).with_name('room.jpg').write_bytes(picture.tobytes())
