"""Security: no foreign code runs, no remote access to files, few permissions."""
from __future__ import annotations

import ast
from dataclasses import fields
from pathlib import Path
from typing import Iterator, TYPE_CHECKING
from xml.etree import ElementTree

import pytest
from qflsd_ros.ros.camera import CameraSettings
from qflsd_ros.ros.parameters.node_parameters import Settings
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter as RosParameter
from rig import Rig

if TYPE_CHECKING:
    from conftest import Peer

ROOT = Path(__file__).parents[2]
POLICY = ElementTree.parse(ROOT / 'config' / 'policies.xml').getroot()
MODULES = {'pickle', 'cPickle', 'dill', 'marshal', 'shelve', 'code', 'codeop', 'pty'}
CALLS = {'eval', 'exec', 'compile', '__import__', 'os.system', 'os.popen', 'yaml.load',
         'yaml.unsafe_load', 'yaml.full_load', 'subprocess.getoutput',
         'subprocess.getstatusoutput', 'np.load', 'numpy.load'}


def dangers(source: str) -> Iterator[str]:
    """Yield the calls and imports that could run foreign code."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from MODULES & {alias.name.partition('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            yield from MODULES & {(node.module or '').partition('.')[0]}
        elif isinstance(node, ast.Call):
            yield from CALLS & {ast.unparse(node.func)}
            for word in node.keywords:
                if word.arg in ('shell', 'allow_pickle') and ast.unparse(word.value) != 'False':
                    yield word.arg


@pytest.mark.parametrize('source', [
    'eval("1")', 'import pickle', 'from marshal import loads', 'import os; os.system("ls")',
    'import subprocess as s; s.run("ls", shell=True)', 'x.load(f, allow_pickle=yes)',
    'def f():\n    import pickle.x', 'yaml.load(text)'])
def test_dangers_are_seen(source: str) -> None:
    assert len(list(dangers(source))) == 1


def test_no_eval_no_pickle_no_shell() -> None:
    files = sorted((ROOT / 'qflsd_ros').rglob('*.py'))
    assert len(files) > 50
    # Compiled kernels: of private folders alone, see test/core/kernels/test_store.py.
    assert {path.name: found for path in files
            if (found := list(dangers(path.read_text(encoding='utf-8'))))
            } == {'by_numba.py': ['pickle']}


@pytest.mark.parametrize('kind, names', [
    (Settings, {'mask'}), (CameraSettings, {'source', 'topic'})])
def test_what_names_files_is_read_only(kind: type, names: set[str]) -> None:
    read_only = {field.name for field in fields(kind) if field.metadata['read_only']}
    assert names <= read_only


def test_nobody_can_make_the_camera_show_a_file(peer: Peer) -> None:
    peer.run('-m', 'qflsd_ros.ros', 'camera', '--ros-args', '-p', 'width:=64', '-p', 'height:=48')
    result, = peer.call(SetParameters, '/camera/set_parameters', parameters=[
        RosParameter('source', value='/etc/passwd').to_parameter_msg()]).results
    assert not result.successful and result.reason


def allowed(node: str, kind: str, way: str) -> set[str]:
    """Return the full names that the policy allows a node."""
    profile, = POLICY.findall(f"enclaves/enclave[@path='/{node}']/profiles/profile")
    assert profile.attrib == {'ns': '/', 'node': node}
    found = [item.text or '' for group in profile.findall(kind) if group.get(way) == 'ALLOW'
             for item in group]
    assert len(set(found)) == len(found) > 0
    return {name if name.startswith('/') else f'/{node}{name[1:]}' if name.startswith('~/')
            else f'/{name}' for name in found}


def names(found: list[tuple[str, list[str]]]) -> set[str]:
    return {name for name, _ in found}


@pytest.mark.parametrize('node, optional', [
    ('detector', {'/clock', '/image/compressed'}), ('camera', {'/clock'})])
def test_the_policy_allows_what_the_node_needs_and_no_more(peer: Peer, node: str,
                                                           optional: set[str]) -> None:
    if node == 'detector':
        Rig(peer, listen=('segments', 'planes')).ready()
    else:
        peer.run('-m', 'qflsd_ros.ros', 'camera', '--ros-args', '-p', 'width:=64')
    peer.until(lambda: node in peer.node.get_node_names())
    wanted = (allowed(node, 'topics', 'publish'), allowed(node, 'topics', 'subscribe') - optional,
              allowed(node, 'services', 'reply'))

    def found() -> tuple[set[str], ...]:
        return (names(peer.node.get_publisher_names_and_types_by_node(node, '/')),
                names(peer.node.get_subscriber_names_and_types_by_node(node, '/')),
                names(peer.node.get_service_names_and_types_by_node(node, '/')))

    peer.until(lambda: found() == wanted)
    assert not peer.node.get_client_names_and_types_by_node(node, '/')


def test_the_policy_is_laid_out_as_sros2_reads_it() -> None:
    assert POLICY.tag == 'policy' and POLICY.get('version') == '0.2.0'
    inside = {'policy': {'enclaves'}, 'enclaves': {'enclave'}, 'enclave': {'profiles'},
              'profiles': {'profile'}, 'profile': {'topics', 'services'}, 'topics': {'topic'},
              'services': {'service'}, 'topic': set(), 'service': set()}
    for element in POLICY.iter():
        assert {child.tag for child in element} <= inside[element.tag]
        assert set(element.attrib) <= {
            'enclave': {'path'}, 'profile': {'ns', 'node'}, 'topics': {'publish', 'subscribe'},
            'services': {'reply', 'request'}, 'policy': {'version'}}.get(element.tag, set())
