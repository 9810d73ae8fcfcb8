"""Lines in space: points, directions, ends and their covariances."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Least ratio of a line's parallax and its deviation, whose inverse is about the relative deviation
# of the depth: 4 %.  Chosen, not tuned; noise in place of parallax reaches 5 to 8.
LEAST_PARALLAX = 25.0


class Lines(NamedTuple):
    """
    N lines of the world; its unit of length is m where that of the poses is.

    A line has a direction of travel, with the brighter side of the edge to the right as seen from
    the views.  Its four degrees of freedom are two shifts of its point, x and y, and two tilts of
    its direction, u and v, along the two unit vectors a and b of ``across``: the line through
    ``point + x a + y b`` with the direction ``direction + u a + v b``.

    Attributes
    ----------
    points
        (N, 3) float64, a point of each line amid the edge that was seen.
    directions
        (N, 3) float64 unit vectors, from the start of the edge to its end.
    across
        (N, 2, 3) float64, unit vectors at right angles to the direction and to each other.
    reaches
        (N, 2) float64, positions of start and end along the direction, from the point.
    covariances
        (N, 4, 4) float64 of x, y, u, v.
    parallaxes
        (N,) float64, how far the planes of the views differ, in standard deviations; 0 where they
        coincide or contradict each other.
    distances
        (N,) float64, mean distances of the points from the optical centres of the views.
    misfits
        (N,) float64, root mean square of the residuals of the views, per degree of freedom, over
        their deviation.  It is below 1/2 for edges, whose flaws are alike in neighbouring views,
        and larger for texture and light, which wander, and with wrong poses.
    views
        (N,) int64, the views that agree with the line.

    """

    points: np.ndarray
    directions: np.ndarray
    across: np.ndarray
    reaches: np.ndarray
    covariances: np.ndarray
    parallaxes: np.ndarray
    distances: np.ndarray
    misfits: np.ndarray
    views: np.ndarray

    @property
    def determined(self) -> np.ndarray:
        """Return whether the views determine each line: (N,) bool."""
        return self.parallaxes >= LEAST_PARALLAX

    @property
    def ends(self) -> np.ndarray:
        """Return start and end of each line: (N, 2, 3)."""
        return self.points[:, None] + self.reaches[..., None] * self.directions[:, None]

    @property
    def moments(self) -> np.ndarray:
        """Return the second half of the Pluecker coordinates (direction, moment): (N, 3)."""
        return np.cross(self.points, self.directions)

    def nearest(self, place: np.ndarray) -> np.ndarray:
        """Return the point of each line that is nearest to a place, (3,): (N, 3)."""
        along = ((place - self.points) * self.directions).sum(axis=1, keepdims=True)
        return self.points + along * self.directions

    @property
    def deviations(self) -> np.ndarray:
        """Return the largest deviation of each point across, as a share of its distance: (N,)."""
        largest = np.linalg.eigvalsh(self.covariances[:, :2, :2])[:, 1]
        return np.sqrt(np.maximum(largest, 0)) / np.maximum(self.distances, 1e-300)

    def covariances_at(self, positions: np.ndarray) -> np.ndarray:
        """
        Return the covariances of points of the lines, across them.

        Parameters
        ----------
        positions
            (N, S) along the direction, from the point.

        Returns
        -------
        covariances
            (N, S, 2, 2) along the two vectors of ``across``.

        """
        t, c = positions[..., None, None], self.covariances[:, None]
        mixed = c[..., :2, 2:] + np.swapaxes(c[..., :2, 2:], -1, -2)
        return c[..., :2, :2] + t * mixed + t ** 2 * c[..., 2:, 2:]

    def chosen(self, which: np.ndarray) -> Lines:
        """Return some of the lines, by a mask or by numbers."""
        return Lines(*(values[which] for values in self))
