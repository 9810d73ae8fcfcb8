"""
Views of a line in space: planes of one image, moved to the world.

The plane of a view, with the unit normal n towards the brighter side, contains the optical centre
c and the edge.  A line through the point P with the direction d is seen from c in the plane with
the normal

    m = w / |w|,  w = (P - c) x d,

the moment of its Pluecker coordinates about c (R. Hartley and A. Zisserman, Multiple View
Geometry, 2003, 3.2.2).  The residual of a view is m across n, weighted by the covariance of n: two
numbers, as a normal does not change its length.
"""
from __future__ import annotations

import math

import numpy as np

from qflsd_ros.core.compilation import inlined
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.pose import Pose

# Columns of a view: the normal; the same plane's two directions across the normal, divided by the
# standard deviations (the residuals are their products with m); the optical centre; and the rays
# of start and end of the arc.  All are in the world.
NORMAL, ACROSS, TURN, CENTRE, START, END, EXPECTED, VIEW = 0, 3, 6, 9, 12, 15, 18, 19
# Deviation of an edge's position, radians, beyond its stated covariance: neighbouring edges,
# texture and the pixel grid shift edges.  It is .05 px at the focal length of 360 px of the
# rendered room, on which it is tuned so that errors are as large as stated: with 30 % less they
# are a quarter more than stated.
FLAW = 1.5e-4
# Share of the squared flaw by which it differs from view to view; the rest is the same in all.
# Tuned on the rendered room; twice as much changes the stated deviations by 5 %.
VARYING = 0.1
TINY = 1e-300       # lower bound of lengths by which vectors are divided
# Point and direction of a line; and a vector.
Line = tuple[float, float, float, float, float, float]
Vector = tuple[float, float, float]


def observed(planes: Planes, pose: Pose, flaw: float = FLAW) -> np.ndarray:
    """
    Return the planes of one image as views of their lines.

    Parameters
    ----------
    planes
        N planes.
    pose
        The pose of the optical frame in the world.
    flaw
        Standard deviation, radians, of an edge's position that its covariance does not contain.

    Returns
    -------
    views
        (N, VIEW) float64, in the world.

    """
    normals, ends = planes.normals, planes.ends
    middle = ends.sum(axis=1)
    middle -= (middle * normals).sum(axis=1, keepdims=True) * normals
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    sides = np.stack([middle, np.cross(normals, middle)], axis=1)
    stated = np.einsum('nai,nij,nbj->nab', sides, planes.covariances, sides)
    # An offset of the whole arc, and a turn about its middle that moves points along it as much
    # in the mean.
    added = np.zeros_like(stated)
    added[:, 0, 0] = flaw ** 2
    added[:, 1, 1] = 12 * flaw ** 2 / ((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)
    across = stated + added
    low = np.linalg.cholesky(across)
    views = np.empty((len(normals), VIEW))
    back = pose.rotation.T
    views[:, NORMAL:ACROSS] = normals @ back
    views[:, ACROSS:CENTRE] = (np.linalg.solve(low, sides) @ back).reshape(-1, 6)
    views[:, CENTRE:START] = pose.centre
    views[:, START:EXPECTED] = (ends @ back).reshape(-1, 6)
    views[:, EXPECTED] = np.trace(np.linalg.solve(across, stated + VARYING * added),
                                  axis1=1, axis2=2)
    return views


@inlined
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Vector:
    """Return the cross product a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined
def dot(row: np.ndarray, column: int, v: Vector) -> float:
    """Return the scalar product of v and three columns of a row, the first of which is given."""
    return row[column] * v[0] + row[column + 1] * v[1] + row[column + 2] * v[2]


@inlined
def moment(view: np.ndarray, line: Line) -> tuple[Vector, float]:
    """Return m of a line seen from a view, and |w|, its distance from the optical centre."""
    x, y, z = cross(line[0] - view[CENTRE], line[1] - view[CENTRE + 1],
                    line[2] - view[CENTRE + 2], line[3], line[4], line[5])
    size = math.sqrt(x * x + y * y + z * z) + TINY
    return (x / size, y / size, z / size), size


@inlined
def square(view: np.ndarray, line: Line) -> float:
    """Return the squared residual of a view; infinite where it shows the line's other side."""
    m, _ = moment(view, line)
    a, b = dot(view, ACROSS, m), dot(view, TURN, m)
    return a * a + b * b if dot(view, NORMAL, m) > 0 else math.inf


@inlined
def place(view: np.ndarray, line: Line, ray: Vector) -> tuple[float, float]:
    """Return where along a line a ray meets it, both seen in their plane, and at what depth."""
    m, _ = moment(view, line)
    qx, qy, qz = line[0] - view[CENTRE], line[1] - view[CENTRE + 1], line[2] - view[CENTRE + 2]
    a, b, c = cross(qx, qy, qz, ray[0], ray[1], ray[2])
    d, e, f = cross(line[3], line[4], line[5], ray[0], ray[1], ray[2])
    below = d * m[0] + e * m[1] + f * m[2]
    if below == 0.0:
        return 0.0, -1.0
    t = -(a * m[0] + b * m[1] + c * m[2]) / below
    return t, ((qx + t * line[3]) * ray[0] + (qy + t * line[4]) * ray[1]
               + (qz + t * line[5]) * ray[2])
