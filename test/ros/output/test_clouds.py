"""Messages contain the data of the arcs, and can be read back."""
from __future__ import annotations

from array import array
from dataclasses import replace
import time

from builtin_interfaces.msg import Time
from hypothesis import given, settings, strategies as st
import numpy as np
from numpy.lib.recfunctions import repack_fields
import pytest
from qflsd_ros import overlay, records
from qflsd_ros.core.arcs import Arcs, TABLE, TRACKED_TABLE
from qflsd_ros.core.geometry.planes import Planes
from qflsd_ros.core.lens.division import DivisionModel
from qflsd_ros.core.lens.straightness import with_straightness
from qflsd_ros.ros.output import clouds, palette
from qflsd_ros.ros.output.markers import markers
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointField
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

HEADER = Header(stamp=Time(sec=12, nanosec=34), frame_id='camera_optical')


def circle_arcs(count: int, seed: int = 0) -> Arcs:
    """Return arcs of random circles; the first of them is straight."""
    random = np.random.default_rng(seed)
    table = np.zeros(count, TABLE)
    radius, begin = random.uniform(50, 500, count), random.uniform(0, 6, count)
    centre = random.uniform(0, 640, (count, 2))
    for name, share in (('start', 0), ('middle', 0.5), ('end', 1)):
        angle = begin + share
        table[name] = centre + radius[:, None] * np.c_[np.cos(angle), np.sin(angle)]
    table['curvature'], table['length'] = 1 / radius, radius
    if count:
        table['start'][0], table['middle'][0], table['end'][0] = (0, 0), (50, 0), (100, 0)
        table['curvature'][0], table['length'][0] = 0, 100
    table['rms'] = random.uniform(0, 1, count)
    table['support'] = np.arange(count) + 20
    return Arcs(table, np.zeros((0, 2)), np.zeros((0, 2), np.int32), np.zeros(count + 1, int))


def tracked(arcs: Arcs) -> Arcs:
    """Return arcs with the tracks 1, 4, 7 and so on."""
    table = np.zeros(len(arcs), TRACKED_TABLE)
    for name in TABLE.names:
        table[name] = arcs.table[name]
    table['track'] = 1 + 3 * np.arange(len(arcs))
    table['age'], table['held'] = 9, np.arange(len(arcs)) % 2
    return replace(arcs, table=table)


@pytest.mark.parametrize('count', [0, 1, 7])
def test_segments_come_back_as_polylines(count: int) -> None:
    arcs = circle_arcs(count)
    message = clouds.segments(HEADER, arcs, 0.2)
    polylines = clouds.polylines(message)
    assert len(polylines) == count
    for polyline, expected in zip(polylines, arcs.polylines(0.2)):
        assert polyline == pytest.approx(expected, abs=1e-4)
    assert message.header == HEADER
    assert message.width * message.point_step == message.row_step == len(message.data)


def test_segment_fields_are_what_every_release_promises() -> None:
    message = clouds.segments(HEADER, circle_arcs(3), 0.2)
    assert [(field.name, field.offset, field.datatype, field.count) for field in message.fields] \
        == [('x', 0, PointField.FLOAT32, 1), ('y', 4, PointField.FLOAT32, 1),
            ('z', 8, PointField.FLOAT32, 1), ('segment', 12, PointField.UINT32, 1),
            ('track', 16, PointField.UINT32, 1)]
    found = clouds.records(message)
    assert (found['z'] == 0).all()
    assert np.unique(found['segment']).tolist() == [0, 1, 2]
    assert (np.diff(found['segment'].astype(int)) >= 0).all()


def test_arc_records_hold_every_column_of_the_table() -> None:
    arcs = circle_arcs(5)
    found = clouds.records(clouds.arc_records(HEADER, arcs))
    for name in TABLE.names:
        if TABLE[name].shape:
            given = np.stack([found[name + '_x'], found[name + '_y']], axis=1)
        else:
            given = found[name]
        assert given == pytest.approx(arcs.table[name], rel=1e-6), name
    assert np.c_[found['x'], found['y'], found['z']] == pytest.approx(
        np.c_[arcs.table['middle'], np.zeros(5)], rel=1e-6)


def test_every_record_carries_its_track() -> None:
    """Also after arcs were left out; consumers that hold it as float32 lose nothing."""
    arcs = tracked(circle_arcs(5))
    wanted = arcs.table['track']
    wanted[4] = 2 ** 24
    found = clouds.records(clouds.arc_records(HEADER, arcs))
    assert found['track'].tolist() == wanted.tolist() == found['track'].astype('f4').tolist()
    assert found['age'].tolist() == [9] * 5 and found['held'].tolist() == [0, 1, 0, 1, 0]
    points = clouds.records(clouds.segments(HEADER, arcs, 0.2))
    assert (points['track'] == wanted[points['segment']]).all()
    arcs = with_straightness(arcs, None)
    arcs.table['straight'] = [1, 0, 1, 0, 1]
    ends = clouds.records(clouds.rectified(HEADER, arcs, DivisionModel(0.0, (480, 640))))
    assert np.unique(ends['segment']).tolist() == [0, 2, 4]
    assert (ends['track'] == wanted[ends['segment']]).all()


def test_the_layout_is_the_same_without_tracks_which_are_0_then() -> None:
    arcs = circle_arcs(3)
    for make in (clouds.arc_records, lambda *some: clouds.segments(*some, 0.2)):
        message = make(HEADER, arcs)
        assert message.fields == make(HEADER, tracked(arcs)).fields
        assert not clouds.records(message)['track'].any()
    found = clouds.records(clouds.arc_records(HEADER, arcs))
    assert not found['age'].any() and not found['held'].any()


@pytest.mark.parametrize('by', palette.CHOICES)
def test_colours_by_track_alone_follow_the_track(by: str) -> None:
    """A line that has another number in the next frame has the same colour."""
    arcs = tracked(circle_arcs(6))
    turned = replace(arcs, table=arcs.table[::-1])
    same = np.array_equal(palette.colours(turned, by)[::-1], palette.colours(arcs, by))
    assert same == (by != 'id')
    untracked = circle_arcs(6)
    assert np.array_equal(palette.colours(untracked, 'track'), palette.colours(untracked, 'id'))


@pytest.mark.parametrize('datatype, constant', [
    ('i1', 'INT8'), ('u1', 'UINT8'), ('i2', 'INT16'), ('u2', 'UINT16'), ('i4', 'INT32'),
    ('u4', 'UINT32'), ('f4', 'FLOAT32'), ('f8', 'FLOAT64')])
def test_types_are_called_as_ros_calls_them(datatype: str, constant: str) -> None:
    assert records.DATATYPES[datatype] == getattr(PointField, constant)


def test_an_empty_result_is_an_empty_message() -> None:
    for message in (clouds.segments(HEADER, Arcs.empty(), 0.1),
                    clouds.arc_records(HEADER, Arcs.empty())):
        assert (message.header, message.height, message.width) == (HEADER, 1, 0)
        assert len(message.data) == 0 and message.fields
        assert len(clouds.records(message)) == 0


def test_records_read_any_byte_order() -> None:
    message = clouds.segments(HEADER, circle_arcs(3), 0.2)
    found = clouds.records(message)
    message.is_bigendian = True
    message.data = array('B', repack_fields(found).byteswap().tobytes())
    assert clouds.records(message).tolist() == found.tolist()


def test_a_cloud_is_dense_where_every_value_is_finite() -> None:
    arcs = circle_arcs(3)
    known = with_straightness(arcs, None)
    assert not clouds.arc_records(HEADER, known).is_dense
    known.table['straight'] = 0.5
    assert clouds.arc_records(HEADER, known).is_dense
    assert clouds.segments(HEADER, arcs, 0.2).is_dense
    assert clouds.arc_records(HEADER, with_straightness(Arcs.empty(), None)).is_dense


def test_plane_records_hold_normal_covariance_and_arc() -> None:
    random = np.random.default_rng(0)
    matrices = random.normal(size=(4, 3, 3))
    planes = Planes(np.array([0, 2, 3, 7]), random.normal(size=(4, 3)),
                    matrices + matrices.transpose(0, 2, 1), random.normal(size=(4, 2, 3)))
    found = clouds.records(clouds.plane_records(HEADER, planes, tracked(circle_arcs(8))))
    assert found['track'].tolist() == [1, 7, 10, 22]
    assert found['segment'].tolist() == [0, 2, 3, 7]
    for i, one in enumerate('xyz'):
        assert found[f'normal_{one}'] == pytest.approx(planes.normals[:, i], rel=1e-6)
        for j, other in list(enumerate('xyz'))[i:]:
            assert found[f'covariance_{one}{other}'] == pytest.approx(
                planes.covariances[:, i, j], rel=1e-6)
        for number, end in enumerate(('start', 'end')):
            assert found[f'{end}_{one}'] == pytest.approx(planes.ends[:, number, i], rel=1e-6)


def test_planes_are_read_as_they_were_written() -> None:
    random = np.random.default_rng(0)
    matrices = random.normal(size=(4, 3, 3))
    planes = Planes(np.array([0, 2, 3, 7]), random.normal(size=(4, 3)),
                    matrices + matrices.transpose(0, 2, 1), random.normal(size=(4, 2, 3)))
    arcs = tracked(circle_arcs(8))
    tracks, found = records.planes_of(clouds.records(clouds.plane_records(HEADER, planes, arcs)))
    assert tracks.tolist() == [1, 7, 10, 22]
    assert found.arcs.tolist() == planes.arcs.tolist()
    for one, other in zip(found[1:], planes[1:]):
        assert one == pytest.approx(other, rel=1e-6)


def test_overlay_is_the_frame_with_its_arcs() -> None:
    gray, arcs = np.full((480, 640), 70, np.uint8), circle_arcs(4)
    message = clouds.overlay_image(HEADER, gray, arcs, 3)
    assert (message.header, message.encoding, message.height, message.width, message.step) == \
        (HEADER, 'bgr8', 480, 640, 1920)
    picture = np.frombuffer(message.data, np.uint8).reshape(480, 640, 3)
    assert (picture == overlay.draw(gray, arcs, 3)).all()


@settings(deadline=None)
@given(frame=st.text(st.characters(exclude_characters='\0', codec='utf-8'), max_size=20),
       count=st.integers(0, 6), sec=st.integers(-2**31, 2**31 - 1))
def test_markers_are_what_the_real_serialiser_reads(frame: str, count: int, sec: int) -> None:
    arcs, header = circle_arcs(count), Header(stamp=Time(sec=sec), frame_id=frame)
    data = markers(header, arcs, 0.5, 0.01, 2)
    message = deserialize_message(data, MarkerArray)
    marker, = message.markers
    assert len(serialize_message(message)) == len(data)
    assert (marker.header, marker.id, marker.ns) == (header, 0, 'arcs')
    assert marker.action == (Marker.ADD if count else Marker.DELETE)
    assert not marker.text and not marker.mesh_resource and not marker.frame_locked
    ends = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 2, 3)
    expected = [np.stack([line[:-1], line[1:]], axis=1) for line in arcs.polylines(0.5)]
    assert ends[..., :2] == pytest.approx(
        0.01 * np.concatenate([np.zeros((0, 2, 2)), *expected]))
    assert not ends[..., 2].any()
    colours = np.array([(colour.b, colour.g, colour.r) for colour in marker.colors])
    chords = [len(line) - 1 for line in arcs.polylines(0.5)]
    assert colours.reshape(-1, 3) * 255 == pytest.approx(
        np.repeat(overlay.colours(np.arange(count)), 2 * np.array(chords, int), axis=0), abs=1e-3)
    assert all(colour.a == 1 for colour in marker.colors)


def test_markers_of_an_empty_result_delete_the_last_ones() -> None:
    marker, = deserialize_message(markers(HEADER, Arcs.empty(), 0.1, 0.01, 2), MarkerArray).markers
    assert (marker.action, marker.ns, marker.id) == (Marker.DELETE, 'arcs', 0)


@pytest.mark.parametrize('by', palette.CHOICES)
def test_markers_have_the_colours_that_are_asked_for(by: str) -> None:
    arcs = circle_arcs(9)
    arcs.table['score'] = np.geomspace(0.5, 2000, 9)
    marker, = deserialize_message(
        markers(HEADER, arcs, 0.5, 0.01, 2, by), MarkerArray).markers
    chords = [len(line) - 1 for line in arcs.polylines(0.5)]
    shown = np.array([(colour.b, colour.g, colour.r) for colour in marker.colors])
    assert shown * 255 == pytest.approx(
        np.repeat(palette.colours(arcs, by), 2 * np.array(chords), axis=0), abs=1e-3)


@pytest.mark.parametrize('by, low, high', [
    ('length', 5, 3000), ('curvature', 0, -0.5), ('score', -3, 1e9)])
def test_colours_go_from_blue_to_red(by: str, low: float, high: float) -> None:
    arcs = circle_arcs(2)
    arcs.table[by] = low, high
    (low_blue, _, low_red), (high_blue, _, high_red) = palette.colours(arcs, by).tolist()
    assert low_blue > low_red and high_red > high_blue


@pytest.mark.parametrize('by', palette.CHOICES)
def test_the_colour_of_an_arc_is_the_same_whatever_is_beside_it(by: str) -> None:
    many, few = circle_arcs(20), circle_arcs(20)
    few = Arcs(few.table[:4], few.edge_points, few.edge_pixels, few.offsets[:5])
    assert (palette.colours(many, by)[:4] == palette.colours(few, by)).all()


def test_markers_are_cheap() -> None:
    """CPU time of this thread for 500 arcs with 20 points each."""
    arcs = circle_arcs(500)
    counts = arcs.vertices(0.38)[1]
    assert counts.mean() == pytest.approx(20, abs=1.5)
    # As after any image in the node, malloc keeps the pages that it has from here on.
    np.ones(1280 * 720 * 3, np.uint8)
    times = []
    for _ in range(100):
        begin = time.thread_time()
        markers(HEADER, arcs, 0.38, 0.01, 1)
        times.append(time.thread_time() - begin)
    assert np.percentile(times, 10) < 2e-3
