"""Maps of lines drawn from above and from the side; imports no ROS."""
from __future__ import annotations

import cv2
import numpy as np

from qflsd_ros.overlay import colours

# All of these are chosen, not tuned, unless stated otherwise.
WIDTH = 640             # px of a view
MARGIN = 24             # px about it
BACKGROUND, EDGES, TEXT = (255, 255, 255), (190, 190, 190), (60, 60, 60)    # B, G, R
DARKER = 0.75           # factor of the colours of tracks, which are bright, on white
# Axes of the world that point right and up in each view.
VIEWS = {'from above': (0, 1), 'from the side': (0, 2)}
SHOWN = (1.0, 99.0)     # percentiles of end points between which a view shows all
FRACTION = 4            # bits of OpenCV's subpixel coordinates: 1 / 16 px, invisible


def draw_map(tracks: np.ndarray, ends: np.ndarray, truth: np.ndarray | None = None) -> np.ndarray:
    """
    Draw lines from above and, below that, from the side.

    Parameters
    ----------
    tracks
        (N,) int, which determine the colours.
    ends
        (N, 2, 3) m, with z upwards.
    truth
        (E, 2, 3) m, true edges, if they are known: drawn by themselves to the left, and in grey
        beneath the lines.

    Returns
    -------
    picture
        (H, W, 3) uint8 blue, green, red.

    """
    low, high = _bounds(ends if truth is None else truth)
    rows = []
    for name, axes in VIEWS.items():
        scale = (WIDTH - 2 * MARGIN) / (high - low)[axes[0]]
        size = round(scale * (high - low)[axes[1]]) + 2 * MARGIN
        frame = low, high, scale, axes
        shades = colours(tracks) * DARKER
        views = [_view(size, f'map, {name}')]
        if truth is not None:
            views.insert(0, _view(size, f'edges, {name}'))
            for view in views:
                _lines(view, frame, truth, np.tile(EDGES, (len(truth), 1)), 1)
            _lines(views[0], frame, truth, np.tile(TEXT, (len(truth), 1)), 1)
        _lines(views[-1], frame, ends, shades, 2)
        _metre(views[-1], scale)
        rows.append(np.concatenate(views, axis=1))
    return np.concatenate(rows, axis=0)


def _bounds(ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest coordinates to show, (3,) each."""
    if not len(ends):
        return -np.ones(3), np.ones(3)
    low, high = np.percentile(ends.reshape(-1, 3), SHOWN, axis=0)
    return low, np.maximum(high, low + 1e-3 * max(float((high - low).max()), 1e-3))


def _view(height: int, name: str) -> np.ndarray:
    view = np.full((height, WIDTH, 3), BACKGROUND, np.uint8)
    cv2.putText(view, name, (MARGIN // 2, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, TEXT, 1,
                cv2.LINE_AA)
    return view


def _lines(view: np.ndarray, frame: tuple[np.ndarray, np.ndarray, float, tuple[int, int]],
           ends: np.ndarray, shades: np.ndarray, width: int) -> None:
    """Draw lines into a view; ``frame`` has its bounds, its px/m and its axes."""
    low, high, scale, (right, up) = frame
    x = MARGIN + scale * (ends[..., right] - low[right])
    y = MARGIN + scale * (high[up] - ends[..., up])
    # Far beyond the picture OpenCV's integers overflow.
    points = np.clip(np.stack([x, y], axis=-1), -1e4, 1e4) * 2 ** FRACTION
    for (start, end), shade in zip(np.rint(points).astype(int).tolist(), shades.tolist()):
        cv2.line(view, start, end, shade, width, cv2.LINE_AA, FRACTION)


def _metre(view: np.ndarray, scale: float) -> None:
    """Draw a metre as a bar in the corner, if it fits."""
    if scale > WIDTH - 2 * MARGIN:
        return
    height, width = view.shape[:2]
    right, bottom = width - MARGIN // 2, height - 8
    cv2.line(view, (round(right - scale), bottom), (right, bottom), TEXT, 2)
    cv2.putText(view, '1 m', (round(right - scale / 2) - 12, bottom - 5),
                cv2.FONT_HERSHEY_SIMPLEX, 0.4, TEXT, 1, cv2.LINE_AA)
