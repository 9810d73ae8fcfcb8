"""The tracks that an arc lies on."""
import numpy as np
import pytest
from qflsd_ros.core.tracking import curve, neighbours, state

SHAPE = 240, 320


def row(start, middle, end) -> np.ndarray:
    """Return a track through three points."""
    result = np.zeros(state.COLUMNS)
    result[state.START:state.START + 6] = [*start, *middle, *end]
    return result


def line(x0, y0, x1, y1) -> np.ndarray:
    """Return a straight track."""
    return row((x0, y0), ((x0 + x1) / 2, (y0 + y1) / 2), (x1, y1))


def owners(tracks, arc, distance: float = 2.0):
    """Return the owner of each point of an arc, and the cosines of the normals."""
    rows, grid = np.array([*tracks, arc]), neighbours.empty(SHAPE)
    neighbours.clear(grid)
    for i in range(len(tracks)):
        neighbours.enter(grid, rows, i, distance)
    count = neighbours.compare(grid, curve.curve(rows, len(tracks)), distance)
    return grid.owners[:count].copy(), grid.cosines[:count].copy()


def test_an_arc_finds_the_track_it_lies_on_within_its_ends():
    found, cosines = owners([line(50, 100, 150, 100)], line(20, 101, 200, 101))
    x = np.linspace(20, 200, len(found))
    assert (found[abs(x - 100) < 49] == 0).all()
    assert (found[abs(x - 100) > 51] == neighbours.NOBODY).all()
    assert np.allclose(cosines[found == 0], 1)


@pytest.mark.parametrize('arc', [line(100, 50, 100, 150), line(50, 80, 150, 130),
                                 line(50, 103, 150, 103), line(200, 100, 300, 100)])
def test_what_crosses_a_track_or_lies_beside_it_finds_none(arc):
    found, _ = owners([line(50, 100, 150, 100)], arc)
    assert (found == neighbours.NOBODY).all()


def test_each_point_belongs_to_the_closest_of_parallel_tracks():
    tracks = [line(50, 100, 150, 100), line(150, 102, 50, 102)]
    for y, closest, sign in ((100.6, 0, 1), (101.4, 1, -1)):
        found, cosines = owners(tracks, line(55, y, 145, y))
        assert (found == closest).all() and np.allclose(cosines, sign)


@pytest.mark.parametrize('distance', [2.0, 9.0])
def test_a_bent_arc_finds_all_of_a_parallel_bent_track(distance):
    angles = np.radians([200, 240, 280])
    inner, outer = ([(160 + r * np.cos(a), 200 + r * np.sin(a)) for a in angles]
                    for r in (100, 100 + 0.9 * distance))
    found, _ = owners([row(*inner)], row(*outer), distance)
    assert np.mean(found == 0) > 0.9


def test_tracks_beyond_the_image_are_found_there():
    found, _ = owners([line(-80, -40, 400, -40)], line(-60, -41, 380, -41))
    assert (found == 0).all()


def test_a_very_long_arc_is_compared_at_fewer_points_per_length():
    found, _ = owners([line(0, 100, 9000, 100)], line(0, 100, 9000, 100))
    assert len(found) == neighbours.POINTS and (found == 0).all()
