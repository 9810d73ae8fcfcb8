"""The package as colcon and pip install it, tried on a copy in a folder of its own."""
from __future__ import annotations

import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest
from qflsd_ros.cli.demo import free_domain
import rclpy

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[1]
TIMEOUT = 180.0  # s; generous: the machine may be busy, and kernels have to be compiled
SOURCES = ('config', 'examples', 'launch', 'qflsd_ros', 'resource', 'test', 'CHANGELOG.rst',
           'LICENSE', 'package.xml', 'pyproject.toml', 'setup.cfg', 'setup.py')
PROFILE = 'config/fastdds.xml'
EXECUTABLES = ('camera', 'demo', 'detect', 'detector')
COLCON = 'import sys; from colcon_core.command import main; sys.exit(main())'
# colcon test runs a small part of the tests here: all of them would run this one again.
PART = ('test/test_overlay.py', 'test/cli/test_inputs.py')


def environment() -> dict[str, str]:
    """Return the environment with this interpreter as python3, and ROS found in its prefix."""
    path = f'{Path(sys.executable).parent}{os.pathsep}{os.environ["PATH"]}'
    return {'AMENT_PREFIX_PATH': sys.prefix} | os.environ | {
        'PATH': path, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def run(folder: Path, *command: str) -> str:
    """Run a command that must succeed, and return what it printed."""
    result = subprocess.run(command, cwd=folder, env=environment(), text=True, timeout=TIMEOUT,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert result.returncode == 0, result.stdout
    return result.stdout


def copy(folder: Path) -> Path:
    """Copy the package, without anything that was built, into a folder."""
    target = folder / 'qflsd_ros'
    target.mkdir(parents=True)
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, target / name,
                            ignore=shutil.ignore_patterns('__pycache__'))
        else:
            shutil.copy(ROOT / name, target / name)
    return target


@pytest.fixture(scope='module')
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a workspace in which colcon has built the package."""
    workspace = tmp_path_factory.mktemp('workspace')
    copy(workspace / 'src')
    run(workspace, sys.executable, '-c', COLCON, 'build')
    return workspace


def test_colcon_build_installs_everything(workspace: Path) -> None:
    """Executables lie where ros2 run looks for them, files where ament looks for them."""
    prefix = workspace / 'install' / 'qflsd_ros'
    for name in EXECUTABLES:
        assert os.access(prefix / 'lib' / 'qflsd_ros' / name, os.X_OK)
    share = prefix / 'share'
    assert (share / 'ament_index' / 'resource_index' / 'packages' / 'qflsd_ros').is_file()
    assert (share / 'qflsd_ros' / 'package.xml').is_file()
    installed = {path.name for path in (share / 'qflsd_ros' / 'config').iterdir()}
    assert installed == {path.name for path in (ROOT / 'config').iterdir()}


def test_the_installed_detector_starts_and_ends(workspace: Path) -> None:
    """``install/qflsd_ros/lib/qflsd_ros/detector`` joins the graph; SIGINT: exit code 0."""
    domain = free_domain()
    command = '. install/setup.sh && exec install/qflsd_ros/lib/qflsd_ros/detector'
    process = subprocess.Popen(
        ['sh', '-c', command], cwd=workspace, text=True, stderr=subprocess.PIPE,
        env=environment() | {'ROS_DOMAIN_ID': str(domain)})
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = rclpy.create_node('packaging', context=context)
    deadline = time.monotonic() + TIMEOUT
    while not node.count_publishers('/detector/segments'):
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.05)
    node.destroy_node()
    context.try_shutdown()
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, stderr
    assert 'Traceback' not in stderr


def test_colcon_test_runs_the_tests(workspace: Path) -> None:
    """Colcon finds pytest and counts tests, none of them failed."""
    run(workspace, sys.executable, '-c', COLCON, 'test', '--pytest-args', *PART)
    said = run(workspace, sys.executable, '-c', COLCON, 'test-result', '--all')
    summary = re.search(r'Summary: (\d+) tests, 0 errors, 0 failures, 0 skipped', said)
    assert summary and int(summary[1]) > 20, said


@pytest.fixture(scope='module')
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a prefix into which pip has installed the package, and it alone."""
    folder = tmp_path_factory.mktemp('pip')
    prefix = folder / 'prefix'
    # Without --ignore-installed, pip would uninstall the package from where this one runs.
    run(folder, sys.executable, '-m', 'pip', 'install', '--no-deps', '--no-build-isolation',
        '--ignore-installed', '--prefix', str(prefix), str(copy(folder)))
    for line in section('Install'):
        if line.startswith('mkdir'):
            run(folder, 'env', f'VIRTUAL_ENV={prefix}', 'bash', '-ec', line)
    return prefix


def section(title: str) -> list[str]:
    """Return the lines of code below a heading of the README."""
    readme = (ROOT / 'README.md').read_text()
    text = re.search(rf'^## {title}\n(.*?)(?=^#)', readme, re.DOTALL | re.MULTILINE)[1]
    return [line.strip() for line in text.splitlines() if line.startswith('    ')]


def within(prefix: Path, *command: str) -> str:
    """Run a command with the package of a prefix, found by Python and by ament."""
    [packages] = prefix.glob('lib/python*/site-packages')
    return run(prefix, 'env', f'PYTHONPATH={packages}',
               f'AMENT_PREFIX_PATH={prefix}:{environment()["AMENT_PREFIX_PATH"]}', *command)


def test_pip_installs_executables_and_what_ros2_run_needs(prefix: Path) -> None:
    """Executables run from bin; ros2 run finds those of the package, and no others."""
    said = within(prefix, sys.executable, '-c', 'from ament_index_python import '
                  'get_package_prefix; print(get_package_prefix("qflsd_ros"))')
    assert said.strip() == str(prefix)
    (prefix / 'bin' / 'python').touch(0o755)  # as in a virtual environment
    found = {path.name for path in (prefix / 'lib' / 'qflsd_ros').iterdir()}
    assert found == set(EXECUTABLES)
    for name in EXECUTABLES:
        assert os.access(prefix / 'lib' / 'qflsd_ros' / name, os.X_OK)
    assert within(prefix, str(prefix / 'bin' / 'detect'), '--help').startswith('usage: detect')


def test_the_demo_finds_its_profile_wherever_it_is_installed(prefix: Path,
                                                             workspace: Path) -> None:
    """The share of a prefix of pip's, that of colcon, and the folder config of a checkout."""
    program = f'from qflsd_ros.cli.demo import shared; print(shared({PROFILE!r}))'
    file = Path('share', 'qflsd_ros', 'config', 'fastdds.xml')
    assert within(prefix, sys.executable, '-c', program).strip() == str(prefix / file)
    built = run(workspace, 'sh', '-c', f'. install/setup.sh && {sys.executable} -c "{program}"')
    assert built.strip() == str(workspace / 'install' / 'qflsd_ros' / file)
    here = run(workspace, sys.executable, '-c', program)
    assert here.strip() == str(ROOT / 'config' / 'fastdds.xml')


def test_the_examples_are_installed(prefix: Path, workspace: Path) -> None:
    """The demo runs the line mapper from there."""
    examples = {path.name for path in (ROOT / 'examples').glob('*.py')}
    for place in (prefix, workspace / 'install' / 'qflsd_ros'):
        folder = place / 'share' / 'qflsd_ros' / 'examples'
        assert {path.name for path in folder.glob('*.py')} == examples


def test_the_package_here_stays_installed(prefix: Path) -> None:
    """Tests install copies elsewhere and leave the one that they run in alone."""
    assert prefix.is_dir()
    for name in EXECUTABLES:
        assert os.access(Path(sys.executable).parent / name, os.X_OK)


INSTALL = """
. script/environment.sh
install_package() {  # in place of pip, which would take a minute
    echo installed >> installations
    (cd "$VENV"/lib/python3*/site-packages && ln -sfn "$ROOT/qflsd_ros")
    install -m 755 /dev/null "$VENV/bin/demo"
}
set_up test
"""


def test_scripts_install_a_package_that_has_gone(tmp_path: Path) -> None:
    """They look at what is there, not only at what they did once."""
    root = copy(tmp_path)
    shutil.copytree(ROOT / 'script', root / 'script')

    def installations() -> int:
        run(root, 'bash', '-euc', INSTALL)
        return len((root / 'installations').read_text().splitlines())

    assert installations() == installations() == 1
    (root / '.venv' / 'bin' / 'demo').unlink()
    assert installations() == installations() == 2
    [link] = (root / '.venv').glob('lib/python3*/site-packages/qflsd_ros')
    link.unlink()
    assert installations() == installations() == 3
