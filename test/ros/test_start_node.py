"""The first start: nodes answer services, and end on a signal, while they compile kernels."""
from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rcl_interfaces.srv import GetParameters
from rig import Rig

if TYPE_CHECKING:
    from conftest import Peer, Process

PROMPT = 10.0  # s; 1 where the machine does nothing else, and 30 for the rest of the kernels


def start(peer: Peer, node: str) -> Process:
    """Start a node with an empty cache; return when it compiles."""
    cache = peer.folder / 'cache'
    process = peer.run('-m', 'qflsd_ros.ros', node, NUMBA_CACHE_DIR=str(cache))
    peer.until(lambda: any(cache.rglob('*.kernel')))
    return process


@pytest.mark.parametrize('node, parameter', [('detector', 'min_length'), ('camera', 'seed')])
def test_it_answers_and_says_what_it_does(peer: Peer, node: str, parameter: str) -> None:
    process = start(peer, node)
    answer = peer.call(GetParameters, f'/{node}/get_parameters', names=[parameter])
    assert len(answer.values) == 1
    peer.until(lambda: 'compiling kernels: ' in process.output)
    assert f'kept in {peer.folder}' in process.output


def test_diagnostics_say_how_far_it_is(peer: Peer) -> None:
    """The level is WARN until detection begins; parameters can be set; no image is dropped."""
    rig = Rig(peer, NUMBA_CACHE_DIR=str(peer.folder / 'cache'))
    first = rig.report('compiling kernels: ')
    assert first.level == DiagnosticStatus.WARN
    assert rig.change(min_length=33.0)[0].successful
    begin, end = (int(report.message.split()[2]) for report in (
        first, rig.report('compiling kernels: ')))
    assert begin <= end < int(first.message.split()[4])
    assert rig.camera.get_subscription_count() == 0


@pytest.mark.parametrize('node, number, pause', [
    ('camera', signal.SIGINT, 0.0), ('camera', signal.SIGTERM, 1.0),
    ('detector', signal.SIGTERM, 0.0), ('detector', signal.SIGINT, 1.0),
    ('detector', signal.SIGTERM, 2.0)])
def test_a_signal_ends_it_at_once(peer: Peer, node: str, number: int, pause: float) -> None:
    process = start(peer, node)
    time.sleep(pause)
    assert process.popen.poll() is None
    begin = time.monotonic()
    assert process.stop(number) == 0
    assert time.monotonic() - begin < PROMPT
    assert 'Traceback' not in process.output and 'Exception' not in process.output


@pytest.mark.parametrize('node', ['camera', 'detector'])
def test_what_the_compiler_raises_ends_the_node(peer: Peer, node: str) -> None:
    """The node does not remain in the graph without ever becoming ready."""
    (peer.folder / 'sitecustomize.py').write_text(
        'import numba.core.compiler as compiler\n'
        'def fail(*_, **__): raise RuntimeError("no compiler")\n'
        'compiler.compile_extra = compiler.Compiler.compile_extra = fail\n')
    process = peer.run('-m', 'qflsd_ros.ros', node, PYTHONPATH=str(peer.folder),
                       NUMBA_CACHE_DIR=str(peer.folder / 'cache'))
    assert process.wait() == 1
    assert 'RuntimeError: no compiler' in process.output
