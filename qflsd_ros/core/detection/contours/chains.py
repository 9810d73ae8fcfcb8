"""
Step 1c: the edge map as ordered chains of pixels, by mutually best links.

Moore-neighbour tracing, the paper's choice, and walks in general depend on the order in which an
image is read: where edges meet, the first chain takes the pixels.  Here each edge pixel has at
most one successor and one predecessor: a link joins two pixels if each is the best neighbour of
the other.  A chain is a path of links with a strong pixel (R. Grompone von Gioi and G. Randall, A
sub-pixel edge detector: an implementation of the Canny/Devernay algorithm, IPOL 2017).  The
chains of an image that is turned or mirrored are the same.

Chains travel at right angles to the gradient, with the brighter side to the right, so that all
pixels of a chain have the same polarity.  Links are evaluated as chains are followed, which leaves
out edges without a strong pixel.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.contours.edges import offset_of, STRONG, VISITED

# The 8 neighbours in order of their direction, from the x axis to the y axis and on.
STEP_X = np.array([1, 1, 0, -1, -1, -1, 0, 1], np.int64)
STEP_Y = np.array([0, 1, 1, 1, 0, -1, -1, -1], np.int64)
ANY_STRONG = np.uint64(STRONG * 0x0101010101010101)     # eight edge pixels at once
BYTE_NUMBERS = np.uint64(0x0001020304050607)
# The neighbour closest to a direction (x, y), by the bits x > 0, y > 0, closest to the x axis, and
# to the y axis.
OCTANTS = np.array([5, 7, 3, 1, 4, 0, 4, 0, 6, 6, 2, 2], np.int64)
TAN_22 = math.sqrt(2) - 1       # tangent of 22.5 degrees: half of an octant
RING = 5                # pixels at a distance of 2 along x or y, within 60 degrees of a direction
LONGEST = 2.0           # px, of a link (IPOL 2017)
TURN = 2.0              # weight of the cosine of a link's turn in its cost (tried on photographs)
# Least cosine of the angle between the gradients of a link (45 to 60 degrees work on photographs).
AGREE = math.cos(math.radians(50.0))


class EdgeMap(NamedTuple):
    """The edge pixels of an image and its gradients, as flat arrays of rows of pixels."""

    edges: np.ndarray       # (H W + padding,) uint8: 0, WEAK, STRONG or VISITED
    dx: np.ndarray          # (H W,) int16 gradients
    dy: np.ndarray
    steps: np.ndarray       # (8,) int64: from a pixel to its neighbours
    ring: np.ndarray        # (8, RING) int64: from a pixel to those at a distance of 2
    width: int


def _ring() -> np.ndarray:
    """Return the pixels at a distance of 2 ahead in each direction: (8, RING, 2), x and y."""
    side = [(x, y) for x in range(-2, 3) for y in range(-2, 3) if max(abs(x), abs(y)) == 2]
    ahead = [sorted(side, key=lambda p: (-(p[0] * x + p[1] * y) / math.hypot(*p), p))[:RING]
             for x, y in zip(STEP_X / np.hypot(STEP_X, STEP_Y), STEP_Y / np.hypot(STEP_X, STEP_Y))]
    return np.array(ahead, np.int64)


RING_AT = _ring()


def edge_map(edges: np.ndarray, dx: np.ndarray, dy: np.ndarray) -> EdgeMap:
    """Return the map of flat ``edges``, padded, and (H, W) gradients."""
    width = dx.shape[1]
    return EdgeMap(edges, dx.reshape(-1), dy.reshape(-1), STEP_Y * width + STEP_X,
                   RING_AT[:, :, 1] * width + RING_AT[:, :, 0], width)


@inlined
def _octant(x: float, y: float) -> int:
    """Return the number (0 to 7) of the neighbour closest to the direction (x, y)."""
    flat, steep = abs(y) < TAN_22 * abs(x), abs(x) < TAN_22 * abs(y)
    return OCTANTS[(x > 0) + 2 * (y > 0) + 4 * flat + 8 * steep]


@inlined
def _agree(image: EdgeMap, p: int, q: int) -> bool:
    """Return whether the gradients at two pixels have about the same direction."""
    gx, gy, hx, hy = (float(image.dx[p]), float(image.dy[p]), float(image.dx[q]),
                      float(image.dy[q]))
    dot = gx * hx + gy * hy
    return (dot > 0) & (dot * dot > AGREE ** 2 * (gx * gx + gy * gy) * (hx * hx + hy * hy))


@inlined
def _is_candidate(image: EdgeMap, p: int, q: int) -> bool:
    return image.edges[q] != 0 and _agree(image, p, q)


@compiled
def _cost(image: EdgeMap, p: int, q: int, x: int, y: int, sign: int) -> float:
    """
    Return the cost of a link from pixel p to q, which is (x, y) px away, or inf.

    It is d (1 + w (1 - u . t)) for the vector d u between both edge points and the tangent t at
    right angles to the sum of both gradients; ``sign`` is 1 ahead and -1 behind.
    """
    px, py = offset_of(image.dx, image.dy, image.width, p)
    qx, qy = offset_of(image.dx, image.dy, image.width, q)
    dx, dy = x + qx - px, y + qy - py
    sx, sy = float(image.dx[p]) + image.dx[q], float(image.dy[p]) + image.dy[q]
    along = sign * (dx * sy - dy * sx) / math.sqrt(sx * sx + sy * sy)
    d = math.sqrt(dx * dx + dy * dy)
    return d * (1 + TURN) - TURN * along if 0 < along and d <= LONGEST else np.inf


@compiled
def _nearest(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the neighbour with the cheapest link within 45 degrees of direction k, or -1."""
    best, least = -1, np.inf
    for turn in range(-1, 2):
        j = (k + turn) & 7
        q = p + image.steps[j]
        if _is_candidate(image, p, q):
            cost = _cost(image, p, q, STEP_X[j], STEP_Y[j], sign)
            if cost < least:
                best, least = q, cost
    return best


@compiled
def _beyond(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the pixel at a distance of 2 with the cheapest link about direction k, or -1."""
    best, least = -1, np.inf
    for i in range(RING):
        q = p + image.ring[k, i]
        if 0 <= q < len(image.dx) and _is_candidate(image, p, q):
            cost = _cost(image, p, q, RING_AT[k, i, 0], RING_AT[k, i, 1], sign)
            if cost < least:
                best, least = q, cost
    return best


@inlined
def _direction(image: EdgeMap, p: int, sign: int) -> int:
    """Return the neighbour (0 to 7) that is ahead (sign 1) of pixel p or behind (-1) it."""
    return _octant(sign * float(image.dy[p]), -sign * float(image.dx[p]))


@inlined
def _only(image: EdgeMap, p: int, k: int) -> tuple[int, int]:
    """Return the edge pixels within 45 degrees of direction k: their number, and the last one."""
    number, only = 0, -1
    for turn in range(-1, 2):
        q = p + image.steps[(k + turn) & 7]
        is_edge = image.edges[q] != 0
        number += is_edge
        only = q if is_edge else only
    return number, only


@inlined
def _best(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the best pixel to link pixel p to in direction k, ahead or behind, or -1."""
    number, only = _only(image, p, k)
    if number == 1:
        return only if _agree(image, p, only) else -1
    return _nearest(image, p, k, sign) if number > 1 else _beyond(image, p, k, sign)


@inlined
def _is_best(image: EdgeMap, p: int, q: int, k: int, sign: int) -> bool:
    """Return whether the best pixel to link q to in direction k is p, ahead or behind."""
    number, only = _only(image, q, k)
    if number == 1:
        return only == p    # both gradients agree: q is the best pixel for p
    best = _nearest(image, q, k, sign) if number > 1 else _beyond(image, q, k, sign)
    return best == p


@inlined
def _follow(image: EdgeMap, p: int, sign: int, pixels: np.ndarray, n: int) -> int:
    """Append the pixels linked to pixel p, ahead or behind, to ``pixels``; return the new n."""
    k = _direction(image, p, sign)
    while True:
        q = _best(image, p, k, sign)
        if q < 0 or image.edges[q] == VISITED:
            return n
        k = _direction(image, q, sign)
        if not _is_best(image, p, q, (k + 4) & 7, -sign):
            return n
        image.edges[q] = VISITED
        pixels[n] = q
        n += 1
        p = q


@inlined
def _first(strong: np.uint64) -> int:
    """Return the number (0 to 7) of the first strong pixel of eight; one at least is strong."""
    # Pixel k leaves bit 8 k + 1 alone.  Multiplication by that bit, shifted right by one, moves
    # byte 7 - k of BYTE_NUMBERS, which is k, to the top.
    lowest = strong & (~strong + np.uint64(1))
    return int(((lowest >> np.uint64(1)) * BYTE_NUMBERS) >> np.uint64(56))


@inlined
def _turn_round(values: np.ndarray, first: int, last: int) -> None:
    while first < last:
        values[first], values[last] = values[last], values[first]
        first += 1
        last -= 1


@inlined
def _chain(image: EdgeMap, p: int, pixels: np.ndarray, n: int) -> int:
    """Append the whole chain through a pixel, from n on; return the new n."""
    image.edges[p] = VISITED
    end = _follow(image, p, -1, pixels, n)
    _turn_round(pixels, n, end - 1)
    pixels[end] = p
    return _follow(image, p, 1, pixels, end + 1)


@compiled
def trace(image: EdgeMap, words: np.ndarray, min_points: int, pixels: np.ndarray,
          offsets: np.ndarray) -> int:
    """
    Follow the chains of an edge map; the pixels of chains are marked as VISITED.

    Parameters
    ----------
    image
        The edge map as :func:`edges.find` leaves it, and the gradients.
    words
        (N,) uint64, the same memory as the edges, padded to whole words by zeros.
    min_points
        Chains of fewer pixels are dropped.
    pixels
        (E,) int32 with room for all edge pixels: receives those of the chains, y W + x, one chain
        after the other.
    offsets
        (E / min_points + 2,) int64: receives where each chain begins, and where the last one ends.

    Returns
    -------
    Number of chains.

    """
    chains, n = 0, 0
    offsets[0] = 0
    for word in range(len(words)):
        strong = words[word] & ANY_STRONG
        while strong != 0:
            end = _chain(image, 8 * word + _first(strong), pixels, n)
            if end - n >= min_points:
                n = end
                chains += 1
                offsets[chains] = n
            strong = words[word] & ANY_STRONG
    return chains
