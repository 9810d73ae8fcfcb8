"""Draw ``attitude.jpg``, the picture of attitude.md, beside this file: python3 doc/attitude.py."""
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from qflsd_ros.attitude_drawing import draw_attitude
from qflsd_ros.core import Detector, estimate_attitude, estimate_distortion
from qflsd_ros.core.attitude.estimation import with_directions
from qflsd_ros.overlay import direction_colours
from qflsd_ros.sources import Scene

FRAME = 650         # shows two walls and the ceiling
SIZE = 800, 600
BITS = 4            # of fixed-point coordinates, for cv2

image = Scene(*SIZE, lam=-0.9, colour=True).image(FRAME)
arcs = Detector().detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
shape = (SIZE[1], SIZE[0])
attitude = estimate_attitude(arcs, shape, estimate_distortion([arcs], shape))
assert attitude is not None and attitude.up is not None and attitude.focal is not None
print(f'focal length {attitude.focal:.1f} +- {attitude.focal_std:.1f} px, up {attitude.up}')
for points, colour in zip(arcs.polylines(),
                          direction_colours(with_directions(arcs, attitude)).tolist()):
    cv2.polylines(image, [np.rint(points * (1 << BITS)).astype(np.int32)], False, colour, 1,
                  cv2.LINE_AA, BITS)
draw_attitude(image, attitude)
picture = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
Path(__file__).with_name('attitude.jpg').write_bytes(picture.tobytes())
