"""The live state of the lens, and its diagnostics."""
from __future__ import annotations

import numpy as np
import pytest
from qflsd_ros.core import Arcs, Detector, DivisionModel
from qflsd_ros.core.lens.conversion import camera_info_terms
from qflsd_ros.core.lens.estimation import LensEstimate
from qflsd_ros.core.lens.tracker import LensTracker
from qflsd_ros.ros import lens
from qflsd_ros.ros.output.camera_info import message as message_of
from qflsd_ros.ros.parameters.node_parameters import Settings
from qflsd_ros.sources import Scene
from std_msgs.msg import Header

SHAPE = (480, 640)
ARCS = Detector().detect(Scene(640, 480, lam=-0.4).image(400))


def test_off_and_fixed_take_no_notice_of_the_arcs():
    camera = lens.CameraLens()
    assert camera.follow(ARCS, SHAPE, Settings(lens='off')) is None
    assert camera.values(Settings(lens='off')) == {'lens': 'off'}
    settings = Settings(lens='fixed', lens_lambda=-0.7, lens_centre_y=250.0)
    model = camera.follow(Arcs.empty(), SHAPE, settings)
    assert model == DivisionModel(-0.7, SHAPE, (319.5, 250.0))
    values = camera.values(settings)
    assert (values['lens'], values['lens lambda']) == ('fixed', '-0.7000')
    assert values['lens centre (px)'] == '319.5, 250.0'
    assert float(values['camera_info residual (px)']) < 0.05
    assert values['camera_info model'] == 'rational_polynomial'
    assert float(values['camera_info radius (px)']) == pytest.approx(np.hypot(320, 250), abs=1)
    assert 'lens lambda deviation' not in values


def test_estimate_follows_the_frames_and_begins_anew_when_asked():
    camera, settings = lens.CameraLens(), Settings(lens='estimate')
    assert camera.follow(Arcs.empty(), SHAPE, settings) is None
    assert camera.values(settings) == {'lens': 'estimate'}
    model = camera.follow(ARCS, SHAPE, settings)
    assert model.lam == pytest.approx(-0.4, abs=0.02) and model.centre is None
    values = camera.values(settings)
    assert float(values['lens lambda']) == pytest.approx(model.lam, abs=1e-4)
    assert 0 < float(values['lens lambda deviation']) < 0.02
    assert int(values['lens arcs that agree']) > 20
    assert float(values['lens share of arcs that agree']) > 0.5
    assert values['lens outlier frames'] == '0'
    # The lens stays the same until the settings of the estimate change.
    assert camera.known(SHAPE, settings) == model
    assert camera.follow(Arcs.empty(), SHAPE, settings) == model
    assert camera.follow(ARCS, SHAPE, Settings(lens_find_centre=True)).centre is not None
    assert camera.known(SHAPE, Settings(lens='off')) is None
    assert camera.follow(Arcs.empty(), SHAPE, settings) is None


def test_what_is_known_before_a_frame():
    camera, settings = lens.CameraLens(), Settings(lens='estimate')
    assert camera.known(SHAPE, settings) is None
    model = camera.follow(ARCS, SHAPE, settings)
    assert camera.known(SHAPE, settings) == model
    # An estimate holds for images of one size; another size replaces it.
    assert camera.known((240, 320), settings) is None
    assert camera.follow(ARCS.scaled(2), (960, 1280), settings).shape == (960, 1280)
    assert camera.known(SHAPE, settings) is None
    # A fixed lens is known for images of any size, before the first one.
    settings = Settings(lens='fixed', lens_lambda=-0.7)
    assert camera.known((3, 5), settings) == DivisionModel(-0.7, (3, 5), (2.0, 1.0))


def test_camera_info():
    model, header = DivisionModel(-0.4, SHAPE, (330.0, 230.0)), Header(frame_id='eye')
    message = message_of(header, model, 300.0)
    assert message.header == header and (message.height, message.width) == SHAPE
    wanted = camera_info_terms(model, 300.0)
    assert message.distortion_model == wanted.distortion_model == 'rational_polynomial'
    assert list(message.d) == wanted.coefficients.tolist() and len(message.d) == 8
    assert message.k.tolist() == [300, 0, 330, 0, 300, 230, 0, 0, 1]
    assert message.r.tolist() == np.eye(3).ravel().tolist()
    assert message.p.tolist() == [300, 0, 330, 0, 0, 300, 230, 0, 0, 0, 1, 0]


@pytest.mark.parametrize('settings, text', [
    (Settings(lens='off'), 'parameter lens is off: must be estimate or fixed'),
    (Settings(lens='estimate'), 'the lens is not known yet')])
def test_a_lens_that_is_not_known(settings, text):
    with pytest.raises(lens.LensError, match=text) as error:
        lens.required(None, settings)
    assert error.value.reason == 'no lens'
    model = DivisionModel(-0.4, SHAPE)
    assert lens.required(model, settings) is model


class Forgetful(LensTracker):
    """A tracker that another thread resets as soon as the estimate has been read."""

    forgets = False

    @property
    def estimate(self) -> LensEstimate | None:
        found = self._found
        if self.forgets:
            self._found = None
        return found

    @estimate.setter
    def estimate(self, value: LensEstimate | None) -> None:
        self._found = value


def test_diagnostics_ask_while_the_lens_is_forgotten(monkeypatch):
    """An image of another size resets the estimate during a report."""
    monkeypatch.setattr(lens, 'LensTracker', Forgetful)
    camera, settings = lens.CameraLens(), Settings(lens='estimate')
    assert camera.follow(ARCS, SHAPE, settings) is not None
    monkeypatch.setattr(Forgetful, 'forgets', True)
    assert 'lens lambda deviation' in camera.values(settings)
    assert 'lens lambda deviation' not in camera.values(settings)
