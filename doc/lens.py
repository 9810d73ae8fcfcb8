"""Draw ``lens.jpg``, the picture of lens.md, beside this file: python3 doc/lens.py."""
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from qflsd_ros.core import Detector, estimate_distortion, rectified
from qflsd_ros.overlay import colours, draw
from qflsd_ros.sources import Scene

FRAME = 400         # as in the first picture
SIZE = 640, 480
ZOOM = 0.5          # of the straightened picture at its centre, to show more of it
BITS = 4            # of fixed-point coordinates, for cv2

image = Scene(*SIZE, lam=-0.6, colour=True).image(FRAME)
arcs = Detector().detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
estimate = estimate_distortion([arcs], (SIZE[1], SIZE[0]))
assert estimate is not None, 'the arcs of this frame determine the lens'
lens = estimate.model
print(f'lambda {lens.lam:.4f}')

pixels = np.stack(np.meshgrid(*map(np.arange, SIZE)), axis=-1)
seen = lens.distort((pixels - lens.origin) / ZOOM + lens.origin).astype(np.float32)
straight = cv2.remap(image, seen, np.empty(0, np.float32), cv2.INTER_LINEAR)
ends = ((rectified(arcs, lens) - lens.origin) * ZOOM + lens.origin) * (1 << BITS)
for (start, end), colour in zip(np.rint(ends).astype(int).tolist(),
                                colours(np.arange(len(arcs))).tolist()):
    cv2.line(straight, start, end, colour, 1, cv2.LINE_AA, BITS)
both = np.hstack([draw(image, arcs), np.full((SIZE[1], 8, 3), 255, np.uint8), straight])
picture = cv2.imencode('.jpg', both, [cv2.IMWRITE_JPEG_QUALITY, 80])[1]
Path(__file__).with_name('lens.jpg').write_bytes(picture.tobytes())
