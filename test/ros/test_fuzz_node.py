"""Random messages, parameters and files give a result or a reason, never an exception."""
from __future__ import annotations

from array import array
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any, Iterator, TYPE_CHECKING

from hypothesis import given, HealthCheck, settings, strategies as st
import numpy as np
import pytest
from qflsd_ros.cli.detect import parser
from qflsd_ros.cli.settings import read, SettingsError
from qflsd_ros.core import Detector, Parameters
from qflsd_ros.core.geometry.planes import planes
from qflsd_ros.core.lens.camera_model import SIZES
from qflsd_ros.ros.input.images import LAYOUTS, read as read_image
from qflsd_ros.ros.input.region import view
from qflsd_ros.ros.output import camera_info
from qflsd_ros.ros.output.camera_info import CalibrationError
from qflsd_ros.ros.parameters import declaration
from qflsd_ros.ros.parameters.node_parameters import check_together, Settings
from qflsd_ros.ros.parameters.origin import origin
from qflsd_ros.sources.frames import FrameError
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rig import EXPECTED, image, Rig, same, SCENE, values
from sensor_msgs.msg import CameraInfo, Image, RegionOfInterest
import yaml

if TYPE_CHECKING:
    from conftest import Peer

KINDS = (Parameters, Settings)
NAMES = [field.name for kind in KINDS for field in fields(kind)]
FLOATS = [field.name for kind in KINDS for field in fields(kind)
          if isinstance(field.default, float)]
VALUES = [0, -1, 7, 2**62, 1e300, '', 'wide', True, [1.0], ['a', 'b'], [], None, {'a': 1},
          '\u2028']
ARCS = Detector().detect(SCENE)

bounded = settings(deadline=None, max_examples=150, derandomize=True, database=None,
                   suppress_health_check=list(HealthCheck))
u32 = st.integers(0, 2**32 - 1)
sizes = st.integers(0, 70) | u32
texts = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=20)
frames = st.builds(
    Image, height=sizes, width=sizes, step=sizes, is_bigendian=st.integers(0, 255),
    encoding=st.sampled_from(sorted(LAYOUTS)) | texts,
    data=st.binary(max_size=5000).map(lambda data: array('B', data)))
whole = st.builds(
    lambda encoding, height, width, padding, seed: image(
        np.random.default_rng(seed).integers(0, 256, (height, 8 * width + padding), np.uint8),
        encoding, width=width),
    st.sampled_from(sorted(LAYOUTS)), st.integers(1, 60), st.integers(1, 60), st.integers(0, 9),
    st.integers(0, 9))
# Not st.floats: libraries that are loaded here may take subnormal numbers for 0, which it minds.
any_float = st.integers(-10**9, 10**9).map(lambda number: number / 1e5) | st.sampled_from(
    [0.0, -0.0, 1e-30, 1e30, -1e300, float('inf'), float('-inf'), float('nan')])
small_float = st.integers(0, 40000).map(lambda number: number / 1e3)
calibrations = st.builds(
    CameraInfo, height=st.just(240), width=st.just(320),
    distortion_model=st.sampled_from(sorted(SIZES)) | texts,
    d=st.lists(any_float, max_size=14).map(lambda items: array('d', items)),
    k=st.lists(any_float, min_size=9, max_size=9) | st.builds(
        lambda f, x: [f, 0.0, x, 0.0, f, x, 0.0, 0.0, 1.0], small_float.map(lambda f: f + 1e-3),
        any_float),
    binning_x=st.integers(0, 2) | u32, binning_y=st.integers(0, 2),
    roi=st.builds(RegionOfInterest, x_offset=sizes, width=st.sampled_from([0, 320, 640])))
anything = (st.booleans() | st.integers(-2**63, 2**63 - 1) | any_float | texts
            | st.lists(st.booleans(), max_size=3) | st.lists(any_float, max_size=3)
            | st.lists(texts, max_size=3) | st.none())
changes = st.dictionaries(st.sampled_from(NAMES), anything, max_size=4) | st.dictionaries(
    st.sampled_from(NAMES), st.integers(0, 40) | small_float, max_size=2)


class Host(Node):
    """A node with the parameters of the detector."""

    def __init__(self, context: Context) -> None:
        super().__init__('detector', context=context)
        self.applied: tuple[Any, ...] = ()
        try:
            declaration.attach(self, KINDS, self._apply, check_together)
        except declaration.ParameterError:
            self.destroy_node()
            raise

    def _apply(self, *settings: Any) -> None:
        self.applied = settings


@pytest.fixture(scope='module')
def rig(module_peer: Peer) -> Iterator[Rig]:
    yield Rig(module_peer, listen=('segments', 'overlay', 'markers')).ready()


@pytest.fixture(scope='module')
def host(module_peer: Peer) -> Iterator[Host]:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=module_peer.context.get_domain_id())
    yield Host(context)
    context.try_shutdown()


def test_images_over_dds(rig: Rig) -> None:
    """Every image is processed, or counted as bad with a reason of this package."""
    rig.settle()

    @bounded
    @given(frames | whole)
    def send(message: Image) -> None:
        rig.publish(message)
        rig.peer.executor.spin_once(0.005)

    send()
    assert same(rig.detect(image(SCENE)), EXPECTED)
    rig.peer.until(rig.accounted, lambda: rig.publish(image(SCENE)), period=0.5)
    counts = values(rig.reports[-1])
    assert int(counts['frames bad']) > 20 and 'frames bad: internal error' not in counts
    assert 'Traceback' not in rig.process.output


@bounded
@given(frames | whole, small_float, st.integers(0, 32768), st.integers(0, 32768),
       st.integers(0, 32768))
def test_images_and_regions(message: Image, white: float, x: int, size: int, width: int) -> None:
    try:
        gray = read_image(message, white)
        mask = view(Settings(roi_x=x, roi_height=size, max_width=width), *gray.shape).mask
    except FrameError as error:
        assert error.reason and '\n' not in str(error)
        return
    assert gray.dtype == np.uint8 and gray.shape == (message.height, message.width)
    assert mask is None or mask.dtype == bool


@bounded
@given(calibrations)
def test_camera_info(info: CameraInfo) -> None:
    try:
        found = planes(ARCS, camera_info.camera_model(info, '/camera_info', 240, 320))
    except CalibrationError as error:
        assert error.reason and '\n' not in str(error)
        return
    assert np.linalg.norm(found.normals, axis=1) == pytest.approx(1)


def test_parameters_of_any_type(host: Host) -> None:
    @bounded
    @given(changes)
    def change(given_: dict[str, Any]) -> None:
        before = host.applied
        result = host.set_parameters_atomically([
            RosParameter(name, value=value) for name, value in given_.items()])
        assert result.successful or result.reason
        if not result.successful:
            assert host.applied is before
        for one in host.applied:
            for field in fields(one):
                assert host.get_parameter(field.name).value == getattr(one, field.name)

    change()


@bounded
@given(st.sampled_from(KINDS), changes)
def test_dataclasses(kind: type, given_: dict[str, Any]) -> None:
    own = {field.name for field in fields(kind)}
    with suppress(TypeError, ValueError):
        kind(**{name: value for name, value in given_.items() if name in own})


def test_files_of_the_command(tmp_path: Path) -> None:
    path = tmp_path / 'p.yaml'

    @bounded
    @given(st.binary(max_size=60) | texts.map(str.encode)
           | changes.map(lambda items: yaml.safe_dump(
               {'/**': {'ros__parameters': items}}).encode())
           | st.recursive(anything, lambda inner: st.lists(inner, max_size=3)
                          | st.dictionaries(texts, inner, max_size=3)).map(
                              lambda tree: yaml.safe_dump({'/**': tree}).encode()))
    def load(content: bytes) -> None:
        path.write_bytes(content)
        with suppress(SettingsError):
            read(parser().parse_args(['a.png', '--params', str(path)]), print)
        assert isinstance(origin(' '.join(NAMES), ['--params-file', str(path)]), str)

    load()


@pytest.mark.parametrize('seed', range(30))
def test_files_of_the_node(tmp_path: Path, module_peer: Peer, seed: int) -> None:
    """A file with several parameters, most of them valid, is accepted, or refused in one line."""
    random = np.random.default_rng(seed)
    given_ = {name: VALUES[random.integers(len(VALUES))] if random.random() < 0.2
              else float(random.integers(1, 9)) for name in random.choice(FLOATS, 3).tolist()}
    path = tmp_path / 'p.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': given_}}, allow_unicode=True))
    context = Context()
    try:
        rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context,
                   domain_id=module_peer.context.get_domain_id())
        host = Host(context)
        assert {name: host.get_parameter(name).value for name in given_} == given_
        host.destroy_node()
    except declaration.ParameterError as error:
        assert '\n' not in str(error) and any(name in str(error) for name in given_)
    except RuntimeError as error:
        assert 'p.yaml' in str(error)  # rcl itself refuses it, and names it
    finally:
        context.try_shutdown()
