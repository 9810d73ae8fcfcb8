"""Draw ``tracks.gif``, lines that keep their colours, beside this file: python3 doc/tracks.py."""
from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from qflsd_ros.core import Parameters
from qflsd_ros.overlay import draw
from qflsd_ros.ros.finding import FrameSequence
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene

SIZE = 400, 300     # px
FIRST, EVERY = 340, 3   # first frame of the scene, and each how many-th is shown
FRAMES, SHOWN = 45, 100     # number of those, and ms for which each is shown
STEP = 12           # grey levels of the background, few of which make a small file
SETTINGS = Settings(trails=6)
PARAMETERS = Parameters(min_length=20.0)

scene, sequence = Scene(*SIZE, lam=-0.4, noise=1.0), FrameSequence()
frames = []
for number in range(FIRST, FIRST + FRAMES * EVERY):
    gray = scene.image(number)
    seen = sequence.find(gray, PARAMETERS, SETTINGS)
    if (number - FIRST) % EVERY == 0:
        pale = cv2.medianBlur(gray, 5) // STEP * STEP // 2 + 20
        frames.append(draw(pale, seen.arcs, 1, seen.tails)[..., ::-1])
# One palette for all frames, from them all, so that a colour is the same in each.
palette = Image.fromarray(np.concatenate(frames[::9])).quantize(256)
pages = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
         for frame in frames]
pages[0].save(Path(__file__).with_name('tracks.gif'), save_all=True, append_images=pages[1:],
              duration=SHOWN, loop=0)
