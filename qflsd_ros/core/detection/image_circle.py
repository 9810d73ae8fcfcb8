"""
The image circle of a fisheye lens, outside of which the image shows nothing.

Corners that are uniform and alike give the grey level of the outside.  Rays run from the border
of the image towards its centre; the first step of the grey level on a ray is a point of the rim,
if the image has one.  Rays that meet stray light, or something dark behind the rim, have their
first step elsewhere.  Therefore the circle is that of three points with which most others agree,
fitted again to these by weighted least squares.  No circle is returned where fewer rays agree than
SHOWN, where more than BEYOND have a step outside, or where the circle is far from the centre.

Limits: an object that looks the same cannot be distinguished from an image circle, such as a disc
before a uniform background about the centre of the image, with a radius of LEAST_RADIUS or more.
Two circles side by side are not found, nor are ellipses.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from qflsd_ros.core.compilation import compiled, inlined
from qflsd_ros.core.detection.region import Disc, Region

# All of these are chosen, not tuned, unless stated otherwise.
RAYS = 64               # a multiple of 8, so that a turned or mirrored image has the same rays
SMALLEST = 32           # px, shorter side of a region in which a circle is sought
CORNER = 8              # px, side of the corners that are compared
SPREAD = 6.0            # grey levels, largest standard deviation in a corner of the outside
ALIKE = 16.0            # grey levels, between corners, and between them and the pixels at the rim
STEP = 12.0             # grey levels, smallest step at the rim
# Standard deviations of the outside that a step has at least: 4.9 of the difference of two means
# of SIDE px, which noise reaches on one of some hundred thousand px of the rays.
NOISES = 4.0
SIDE = 3                # px that are averaged on either side of a step
GAP = 6                 # px between the middles of the two sides: the rise of a blurred rim
RISE = 32               # px from the first step on a ray within which its rise ends
END = 0.25              # of the steepest slope, at which the rise ends
LEAST_RADIUS = 0.4      # of the shorter side of the image
OFF_CENTRE = 0.125      # of the shorter side, largest distance of the two centres
NEAR = 0.01             # of the radius, and 1 px: distance of a ray's step from the circle
ROUND = 0.5             # of NEAR, largest rms distance: that of random steps is 0.58
# Least share of the rays on which the rim lies in the image that show it, and largest share with
# a step outside of it.  Ten photographs through fisheyes have 0.49 or more and 0.15 or less; the
# best circles in 689 images without a rim 0.29 or less, and those 0.43 or more.
SHOWN, BEYOND = 0.4, 0.25
QUADRANT = 0.2          # least share of the rays that show the rim, in a quadrant of the image
QUADRANTS = 3           # of four that must show the rim: in one the scene may be dark
FEWEST = 8              # rays that show the rim
ROUNDS = 4              # of least squares: further ones move the rim by less than 0.01 px
COVERED = 0.9           # share of the rays whose rise ends within the margin
TRUST = 2.0             # rms distances of the rim from its circle that the margin covers

Circle = tuple[float, float, float]     # x, y from the centre of the image, and radius, px


class ImageCircle(NamedTuple):
    """
    The rim of an image circle, px; (0, 0) is the centre of the top-left pixel.

    Attributes
    ----------
    x, y, radius
        The circle where the grey level changes most.
    margin
        How far inside of it the blur of the rim reaches.

    """

    x: float
    y: float
    radius: float
    margin: float

    @property
    def clear(self) -> Disc:
        """
        Return the disc in which the image shows the scene alone.

        Its figures are whole px, so that the rim of one camera has the same disc in most images.
        """
        x, y = round(self.x), round(self.y)
        moved = math.hypot(x - self.x, y - self.y)
        return Disc(float(x), float(y), float(math.floor(self.radius - self.margin - moved)))

    def scaled(self, factor: int) -> ImageCircle:
        """Return the circle in an image of which this one is the means of factor^2 pixels."""
        shift = (factor - 1) / 2
        return ImageCircle(self.x * factor + shift, self.y * factor + shift,
                           self.radius * factor, self.margin * factor)


class _Rays(NamedTuple):
    """The rays of an image, in the order of their angle."""

    profile: np.ndarray     # (longest ray,) float64: grey levels along one ray, from the border
    ways: np.ndarray        # (RAYS, 2) float64: directions from the centre of the image
    ends: np.ndarray        # (RAYS,) float64 px from the centre to where the ray begins
    numbers: np.ndarray     # (RAYS,) int64: the rays that have a step, in order, M of them
    steps: np.ndarray       # (RAYS, 2) float64 px: their first steps, from the centre of the image
    rises: np.ndarray       # (RAYS,) float64 px from there inwards to the end of the rise


class _Ray(NamedTuple):
    """Samples 1 px apart along a ray, from the border of the region inwards."""

    x: float        # px, of the first sample
    y: float
    dx: float       # px, from a sample to the next
    dy: float
    samples: int    # their number


def find_image_circle(gray: np.ndarray, where: Region) -> ImageCircle | None:
    """
    Return the image circle of a (H, W) uint8 image, None without one.

    Masked pixels of ``where``, a region of the image, are not read: at least two corners of the
    region must show the outside.
    """
    if min(where.bottom - where.top, where.right - where.left) < SMALLEST:
        return None
    rays = _Rays(np.empty(sum(gray.shape)), np.empty((RAYS, 2)), np.empty(RAYS),
                 np.empty(RAYS, np.int64), np.empty((RAYS, 2)), np.empty(RAYS))
    found, x, y, radius, margin = _find(gray, where, rays)
    return ImageCircle(x, y, radius, margin) if found else None


@inlined
def _place(where: Region, corner: int) -> tuple[int, int]:
    """Return top and left of a corner of a region, by its number."""
    return (where.top if corner < 2 else where.bottom - CORNER,
            where.left if corner % 2 == 0 else where.right - CORNER)


@inlined
def _is_allowed(where: Region, top: int, left: int) -> bool:
    """Return whether no pixel of a corner is masked."""
    for y in range(top, top + CORNER):
        for x in range(left, left + CORNER):
            if not where.allowed[y, x]:
                return False
    return True


@inlined
def _corner(gray: np.ndarray, top: int, left: int) -> tuple[float, float]:
    """Return mean and standard deviation of the grey levels of a corner."""
    total, squares = 0.0, 0.0
    for y in range(top, top + CORNER):
        for x in range(left, left + CORNER):
            total += gray[y, x]
            squares += float(gray[y, x]) ** 2
    mean = total / CORNER ** 2
    return mean, math.sqrt(max(0.0, squares / CORNER ** 2 - mean * mean))


@inlined
def _outside(gray: np.ndarray, where: Region) -> tuple[bool, float, float]:
    """
    Return whether corners are uniform and alike, their mean grey level and standard deviation.

    All corners of the region but one must be, and two at least: one may show a caption.
    """
    usable, most, level, spread = 0, 0, 0.0, 0.0
    for a in range(4):
        top_a, left_a = _place(where, a)
        if where.masked and not _is_allowed(where, top_a, left_a):
            continue
        usable += 1
        mean_a, spread_a = _corner(gray, top_a, left_a)
        if spread_a > SPREAD:
            continue
        count, means, spreads = 0, 0.0, 0.0
        for b in range(4):
            top_b, left_b = _place(where, b)
            if where.masked and not _is_allowed(where, top_b, left_b):
                continue
            mean_b, spread_b = _corner(gray, top_b, left_b)
            if spread_b <= SPREAD and abs(mean_b - mean_a) <= ALIKE:
                count, means, spreads = count + 1, means + mean_b, spreads + spread_b
        if count > most:
            most, level, spread = count, means / count, spreads / count
    return most >= max(2, usable - 1), level, spread


@inlined
def _ray(where: Region, way: np.ndarray) -> tuple[_Ray, float]:
    """Return a ray by its direction (2,), and how far from the centre it begins, px."""
    height, width = where.allowed.shape
    x, y, ux, uy = (width - 1) / 2, (height - 1) / 2, way[0], way[1]
    begin = min(x / abs(ux), y / abs(uy))
    end = (LEAST_RADIUS - OFF_CENTRE) * min(height, width) - SIDE - GAP
    if not where.masked:
        return _Ray(x + begin * ux, y + begin * uy, -ux, -uy, int(begin - end)), begin
    while begin > end and not where.allowed[int(y + begin * uy + 0.5), int(x + begin * ux + 0.5)]:
        begin -= 1
    last = begin
    while last > end and where.allowed[int(y + last * uy + 0.5), int(x + last * ux + 0.5)]:
        last -= 1
    return _Ray(x + begin * ux, y + begin * uy, -ux, -uy, int(begin - last)), begin


@inlined
def _fill(gray: np.ndarray, ray: _Ray, profile: np.ndarray, filled: int, wanted: int) -> int:
    """Sample a ray until ``wanted`` samples are filled, or all; return how many are."""
    last = min(wanted, ray.samples)
    for k in range(filled, last):
        profile[k] = gray[int(ray.y + k * ray.dy + 0.5), int(ray.x + k * ray.dx + 0.5)]
    return max(filled, last)


@inlined
def _change(profile: np.ndarray, k: int) -> float:
    """Return the grey level GAP px further in minus that of the SIDE samples from k on."""
    change = 0.0
    for j in range(k, k + SIDE):
        change += profile[j + GAP] - profile[j]
    return change / SIDE


@inlined
def _first_step(gray: np.ndarray, ray: _Ray, level: float, step: float,
                profile: np.ndarray) -> tuple[bool, int, int]:
    """
    Return whether a ray has a step before it leaves the outside, its sample, and how many are.

    From the sample of the step on, the grey level changes most.
    """
    best, place, filled = 0.0, 0, 0
    for k in range(ray.samples - SIDE - GAP + 1):
        filled = _fill(gray, ray, profile, filled, k + SIDE + GAP)
        # Most pixels of the outside are so close to its level that they end no step.
        if best == 0 and 2 * abs(profile[filled - 1] - level) < step:
            continue
        change = abs(_change(profile, k))
        if best == 0 and abs(profile[k] - level) > ALIKE:
            break
        if best == 0 and change < step:
            continue
        if change <= best:
            break
        best, place = change, k
    return best > 0, place, _fill(gray, ray, profile, filled, place + RISE)


@inlined
def _edge(profile: np.ndarray, count: int, place: int) -> tuple[float, float]:
    """Return where a step is, its centroid, and how far from there its rise ends, in samples."""
    sign = 1.0 if _change(profile, place) > 0 else -1.0
    total, moment, steepest = 0.0, 0.0, 0.0
    for j in range(place, place + SIDE + GAP - 1):
        slope = max(0.0, sign * (profile[j + 1] - profile[j]))
        total, moment, steepest = total + slope, moment + slope * (j + 0.5), max(steepest, slope)
    middle = moment / total
    j = int(middle + 0.5)
    while j + 2 < count and sign * (profile[j + 2] - profile[j]) / 2 > END * steepest:
        j += 1
    return middle, j - middle


@compiled
def _trace(gray: np.ndarray, where: Region, level: float, step: float, rays: _Rays) -> int:
    """Find the first step on each ray, of ``step`` grey levels or more; return how many have."""
    found = 0
    for i in range(RAYS):
        angle = 2 * math.pi * (i + 0.5) / RAYS
        rays.ways[i, 0], rays.ways[i, 1] = math.cos(angle), math.sin(angle)
        ray, rays.ends[i] = _ray(where, rays.ways[i])
        is_found, place, count = _first_step(gray, ray, level, step, rays.profile)
        if not is_found:
            continue
        middle, rises = _edge(rays.profile, count, place)
        rays.steps[found, 0] = ray.x + middle * ray.dx - (gray.shape[1] - 1) / 2
        rays.steps[found, 1] = ray.y + middle * ray.dy - (gray.shape[0] - 1) / 2
        rays.rises[found], rays.numbers[found] = rises, i
        found += 1
    return found


@inlined
def _through(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> Circle:
    """Return the circle through three points, (2,) px each; all nan where they are collinear."""
    bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    area = 2 * (bx * cy - by * cx)
    if area == 0:
        return math.nan, math.nan, math.nan
    b2, c2 = bx * bx + by * by, cx * cx + cy * cy
    x, y = (cy * b2 - by * c2) / area, (bx * c2 - cx * b2) / area
    return a[0] + x, a[1] + y, math.sqrt(x * x + y * y)


@inlined
def _is_plausible(circle: Circle, shorter: float) -> bool:
    """Return whether a circle is about the centre, and large enough; not if it is nan."""
    return (math.hypot(circle[0], circle[1]) <= OFF_CENTRE * shorter
            and circle[2] >= LEAST_RADIUS * shorter)


@inlined
def _weight(point: np.ndarray, circle: Circle) -> tuple[float, float]:
    """Return the distance of a point (2,) from a circle, px outwards, and its weight (Tukey)."""
    x, y = point[0] - circle[0], point[1] - circle[1]
    distance = math.sqrt(x * x + y * y) - circle[2]
    share = distance / (NEAR * circle[2] + 1)
    return distance, max(0.0, 1 - share * share) ** 2


@compiled
def _most_agreed(points: np.ndarray, count: int, shorter: float) -> tuple[float, Circle]:
    """
    Return the plausible circle of three points with the largest sum of weights, and that sum.

    The three, of ``count`` points in the order of their angle, are a third of them apart.
    """
    most, best = 0.0, (0.0, 0.0, 0.0)
    third = count // 3
    for i in range(third):
        circle = _through(points[i], points[i + third], points[i + 2 * third])
        if not _is_plausible(circle, shorter):
            continue
        total = 0.0
        for j in range(count):
            total += _weight(points[j], circle)[1]
        if total > most:
            most, best = total, circle
    return most, best


@compiled
def _improved(points: np.ndarray, count: int, circle: Circle) -> Circle:
    """Return the circle after a step of weighted least squares (Gauss and Newton)."""
    xx = xy = yy = x = y = n = rx = ry = r = 0.0
    for i in range(count):
        distance, weight = _weight(points[i], circle)
        ux, uy = points[i, 0] - circle[0], points[i, 1] - circle[1]
        size = max(1e-9, math.sqrt(ux * ux + uy * uy))
        ux, uy = ux / size, uy / size
        xx, xy, yy = xx + weight * ux * ux, xy + weight * ux * uy, yy + weight * uy * uy
        x, y, n = x + weight * ux, y + weight * uy, n + weight
        rx, ry, r = rx + weight * distance * ux, ry + weight * distance * uy, r + weight * distance
    # Sums less those of the means: the radius is eliminated.
    xx, xy, yy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    rx, ry = rx - x * r / n, ry - y * r / n
    determinant = xx * yy - xy * xy
    if determinant < 1e-9:
        return circle
    dx, dy = (yy * rx - xy * ry) / determinant, (xx * ry - xy * rx) / determinant
    return circle[0] + dx, circle[1] + dy, circle[2] + (r - x * dx - y * dy) / n


@inlined
def _reach(way: np.ndarray, circle: Circle) -> float:
    """Return how far from the centre of the image a ray of a direction meets a circle, px."""
    along = way[0] * circle[0] + way[1] * circle[1]
    across = way[1] * circle[0] - way[0] * circle[1]
    return along + math.sqrt(circle[2] ** 2 - across * across)


@compiled
def _judge(rays: _Rays, found: int, circle: Circle) -> tuple[bool, float]:
    """
    Return whether the rays show a rim, and the rms distance from it of the steps that are near.

    Only rays on which the rim lies in the image count.
    """
    near, squares = NEAR * circle[2] + 1, 0.0
    next_found = count = shown = beyond = quadrants = count_here = shown_here = 0
    for i in range(RAYS):
        if i % (RAYS // 4) == 0:
            count_here = shown_here = 0
        is_found = next_found < found and rays.numbers[next_found] == i
        if rays.ends[i] - _reach(rays.ways[i], circle) >= SIDE + GAP:
            count, count_here = count + 1, count_here + 1
            if is_found:
                distance, weight = _weight(rays.steps[next_found], circle)
                beyond += int(distance > near)
                if weight > 0:
                    shown, shown_here = shown + 1, shown_here + 1
                    squares += distance * distance
        next_found += int(is_found)
        if (i + 1) % (RAYS // 4) == 0:
            quadrants += int(shown_here > 0 and shown_here >= QUADRANT * count_here)
    rms = math.sqrt(squares / max(1, shown))
    return (shown >= max(float(FEWEST), SHOWN * count) and beyond <= BEYOND * count
            and quadrants >= QUADRANTS and rms <= ROUND * near), rms


@compiled
def _margin(rays: _Rays, found: int, circle: Circle) -> float:
    """Return how far inwards of a rim the rise of the grey level has ended on most rays, px."""
    near = NEAR * circle[2] + 1
    for rise in range(int(near)):
        shown = covered = 0
        for i in range(found):
            if _weight(rays.steps[i], circle)[1] > 0:
                shown, covered = shown + 1, covered + int(rays.rises[i] <= rise)
        if covered >= COVERED * shown:
            return float(rise)
    return near


@compiled
def _find(gray: np.ndarray, where: Region, rays: _Rays) -> tuple[bool, float, float, float, float]:
    """Return whether there is an image circle, its centre and radius, and its margin, px."""
    uniform, level, spread = _outside(gray, where)
    if not uniform:
        return False, 0.0, 0.0, 0.0, 0.0
    shorter = float(min(gray.shape))
    found = _trace(gray, where, level, max(STEP, NOISES * spread), rays)
    agreed, circle = _most_agreed(rays.steps, found, shorter)
    if agreed == 0:
        return False, 0.0, 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        circle = _improved(rays.steps, found, circle)
    shown, rms = _judge(rays, found, circle)
    return (shown and _is_plausible(circle, shorter), (gray.shape[1] - 1) / 2 + circle[0],
            (gray.shape[0] - 1) / 2 + circle[1], circle[2],
            _margin(rays, found, circle) + TRUST * rms)
