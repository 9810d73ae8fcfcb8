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
from qflsd_ros.core.detection.contours.edges import offset_of, SECTOR, STEPS, STRONG, VISITED
from qflsd_ros.core.detection.contours.sectors import POSITION, SECTORS

ANY_STRONG = np.uint64(STRONG * 0x0101010101010101)     # eight edge pixels at once
BYTE_NUMBERS = np.uint64(0x0001020304050607)
RING = 5                # pixels at a distance of 2 along x or y, within 60 degrees of a direction
LONGEST = 2.0           # px, of a link (IPOL 2017)
TURN = 2.0              # weight of the cosine of a link's turn in its cost (tried on photographs)
# Least cosine of the angle between the gradients of a link (45 to 60 degrees work on photographs).
AGREE = math.cos(math.radians(50.0))
# Sectors between two gradients, up to which and from which on a comparison of their cosine with
# AGREE is not needed: n sectors apart they are n - 1 to n + 1 sectors apart in angle.
SURE = int(math.acos(AGREE) * SECTORS / (2 * math.pi)) - 1
EXCLUDED = int(math.ceil(math.acos(AGREE) * SECTORS / (2 * math.pi))) + 1

# Codes of ONLY beside the numbers of neighbours: more than one edge pixel lies ahead, or none.
SEVERAL, NO = 8, 9

Offset = tuple[np.float32, np.float32]      # x and y, px


class EdgeMap(NamedTuple):
    """The edge pixels of an image and its gradients, as flat arrays of rows of pixels."""

    edges: np.ndarray       # (H W + padding,) uint8, as edges.find leaves it
    around: np.ndarray      # (H W,) uint8, as edges.find leaves it
    steps: np.ndarray       # (8,) int64: from a pixel to its neighbours
    dx: np.ndarray          # (H W,) int16 gradients
    dy: np.ndarray
    ring: np.ndarray        # (8, RING) int64: from a pixel to those at a distance of 2
    width: int


def _neighbours() -> np.ndarray:
    """
    Return the neighbour (0 to 7) ahead of an edge pixel, for each sector of its gradient.

    It is the closest to the direction at right angles to the gradient, brighter side on the right.
    """
    angles = (2 * POSITION + 1) * math.pi / SECTORS - math.pi / 2
    return np.rint(angles / (math.pi / 4)).astype(np.int64) % 8


def _ring() -> np.ndarray:
    """Return the pixels at a distance of 2 ahead in each direction: (8, RING, 2), x and y."""
    side = [(x, y) for x in range(-2, 3) for y in range(-2, 3) if max(abs(x), abs(y)) == 2]
    ahead = [sorted(side, key=lambda p: (-(p[0] * x + p[1] * y) / math.hypot(*p), p))[:RING]
             for x, y in STEPS / np.hypot(*STEPS.T)[:, None]]
    return np.array(ahead, np.int64)


NEIGHBOUR = _neighbours()
# The three neighbours within 45 degrees of each direction.
FAN = (np.arange(8)[:, None] + (-1, 0, 1)) % 8


def _only() -> np.ndarray:
    """Return the only edge pixel ahead by direction and bits of all neighbours, or NO, SEVERAL."""
    only = np.empty((8, 256), np.uint8)
    for k in range(8):
        for bits in range(256):
            ahead = [j for j in FAN[k] if bits >> j & 1]
            only[k, bits] = ahead[0] if len(ahead) == 1 else SEVERAL if ahead else NO
    return only


ONLY = _only()
RING_AT = _ring()


def edge_map(edges: np.ndarray, around: np.ndarray, dx: np.ndarray, dy: np.ndarray) -> EdgeMap:
    """Return the map of flat ``edges``, padded, (H, W) neighbours and (H, W) gradients."""
    width = dx.shape[1]
    return EdgeMap(edges, around.reshape(-1), STEPS @ (1, width), dx.reshape(-1), dy.reshape(-1),
                   RING_AT[:, :, 1] * width + RING_AT[:, :, 0], width)


@inlined
def _agree(image: EdgeMap, p: int, q: int) -> bool:
    """Return whether the gradients at two edge pixels have about the same direction."""
    apart = (POSITION[image.edges[p] & SECTOR] - POSITION[image.edges[q] & SECTOR]) % SECTORS
    apart = min(apart, SECTORS - apart)
    if apart <= SURE or apart >= EXCLUDED:
        return apart <= SURE
    gx, gy, hx, hy = (float(image.dx[p]), float(image.dy[p]), float(image.dx[q]),
                      float(image.dy[q]))
    dot = gx * hx + gy * hy
    return (dot > 0) & (dot * dot > AGREE ** 2 * (gx * gx + gy * gy) * (hx * hx + hy * hy))


@inlined
def _cost(image: EdgeMap, p: int, from_p: Offset, q: int, step: tuple[int, int],
          sign: int) -> float:
    """
    Return the cost of a link from pixel p to q, which is ``step`` (x, y) px away, or inf.

    It is d (1 + w (1 - u . t)) for the vector d u between both edge points and the tangent t at
    right angles to the sum of both gradients; ``from_p`` is where the edge point lies relative to
    p, and ``sign`` is 1 ahead and -1 behind.
    """
    qx, qy = offset_of(image.dx, image.dy, image.width, q)
    dx, dy = step[0] + qx - from_p[0], step[1] + qy - from_p[1]
    sx, sy = float(image.dx[p]) + image.dx[q], float(image.dy[p]) + image.dy[q]
    along = sign * (dx * sy - dy * sx) / math.sqrt(sx * sx + sy * sy)
    d = math.sqrt(dx * dx + dy * dy)
    return d * (1 + TURN) - TURN * along if 0 < along and d <= LONGEST else np.inf


@compiled
def _nearest(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the neighbour with the cheapest link within 45 degrees of direction k, or -1."""
    best, least = -1, np.inf
    from_p = offset_of(image.dx, image.dy, image.width, p)
    for i in range(FAN.shape[1]):
        j = FAN[k, i]
        q = p + image.steps[j]
        if image.edges[q] != 0 and _agree(image, p, q):
            cost = _cost(image, p, from_p, q, (STEPS[j, 0], STEPS[j, 1]), sign)
            if cost < least:
                best, least = q, cost
    return best


@compiled
def _beyond(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the pixel at a distance of 2 with the cheapest link about direction k, or -1."""
    best, least = -1, np.inf
    for i in range(RING):
        q = p + image.ring[k, i]
        if 0 <= q < len(image.dx) and image.edges[q] != 0 and _agree(image, p, q):
            from_p = offset_of(image.dx, image.dy, image.width, p)
            cost = _cost(image, p, from_p, q, (RING_AT[k, i, 0], RING_AT[k, i, 1]), sign)
            if cost < least:
                best, least = q, cost
    return best


@inlined
def _direction(code: int, sign: int) -> int:
    """Return the neighbour (0 to 7) that is ahead (sign 1) of an edge pixel or behind (-1) it."""
    return (NEIGHBOUR[code & SECTOR] + 2 - 2 * sign) & 7


@inlined
def _best(image: EdgeMap, p: int, k: int, sign: int) -> int:
    """Return the best pixel to link pixel p to in direction k, ahead or behind, or -1."""
    only = ONLY[k, image.around[p]]
    if only < SEVERAL:
        q = p + image.steps[only]
        return q if _agree(image, p, q) else -1
    return _nearest(image, p, k, sign) if only == SEVERAL else _beyond(image, p, k, sign)


@inlined
def _is_best(image: EdgeMap, p: int, q: int, k: int, sign: int) -> bool:
    """Return whether the best pixel to link q to in direction k is p, ahead or behind."""
    only = ONLY[k, image.around[q]]
    if only < SEVERAL:      # both gradients agree: q is the best pixel for p
        return q + image.steps[only] == p
    best = _nearest(image, q, k, sign) if only == SEVERAL else _beyond(image, q, k, sign)
    return best == p


@inlined
def _follow(image: EdgeMap, p: int, sign: int, pixels: np.ndarray, n: int) -> int:
    """Append the pixels linked to pixel p, ahead or behind, to ``pixels``; return the new n."""
    k = _direction(image.edges[p], sign)
    while True:
        q = _best(image, p, k, sign)
        if q < 0 or image.edges[q] & VISITED:
            return n
        k = _direction(image.edges[q], sign)
        if not _is_best(image, p, q, (k + 4) & 7, -sign):
            return n
        image.edges[q] = image.edges[q] & ~STRONG | VISITED
        pixels[n] = q
        n += 1
        p = q


@inlined
def _first(strong: np.uint64) -> int:
    """Return the number (0 to 7) of the first strong pixel of eight; one at least is strong."""
    # The lowest bit is STRONG in byte k.  Divided by STRONG, it moves byte 7 - k of BYTE_NUMBERS,
    # which is k, to the top by multiplication.
    lowest = strong & (~strong + np.uint64(1))
    return int((lowest // np.uint64(STRONG) * BYTE_NUMBERS) >> np.uint64(56))


@inlined
def _turn_round(values: np.ndarray, first: int, last: int) -> None:
    while first < last:
        values[first], values[last] = values[last], values[first]
        first += 1
        last -= 1


@inlined
def _chain(image: EdgeMap, p: int, pixels: np.ndarray, n: int) -> int:
    """Append the whole chain through a pixel, from n on; return the new n."""
    image.edges[p] = image.edges[p] & ~STRONG | VISITED
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
