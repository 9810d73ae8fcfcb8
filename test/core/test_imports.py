"""The core needs numpy, OpenCV and numba alone."""
from __future__ import annotations

import subprocess
import sys

SCRIPT = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in REFUSED or name.startswith(INNER):
            raise AssertionError('the core imports ' + name)

REFUSED = {'rclpy', 'sensor_msgs', 'std_msgs', 'visualization_msgs', 'geometry_msgs',
           'diagnostic_msgs', 'rcl_interfaces', 'rosidl_parser', 'builtin_interfaces',
           'ament_index_python', 'rosbags', 'tqdm'}
INNER = ('qflsd_ros.ros', 'qflsd_ros.sources', 'qflsd_ros.cli')
sys.meta_path.insert(0, Refuse())
for name in list(sys.modules):
    if name.split('.')[0] in REFUSED:
        del sys.modules[name]

import pkgutil, importlib
import qflsd_ros.core
names = [module.name for module in pkgutil.iter_modules(qflsd_ros.core.__path__)]
for name in names:
    importlib.import_module('qflsd_ros.core.' + name)
assert 'detector' in names and not REFUSED & {name.split('.')[0] for name in sys.modules}
print(len(names))
"""


def test_no_ros_and_nothing_above_the_core():
    done = subprocess.run([sys.executable, '-c', SCRIPT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 10
