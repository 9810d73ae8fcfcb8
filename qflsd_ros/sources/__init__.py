"""
Sources of images, independent of ROS: the synthetic scene, files, videos, webcams, rosbag2.

Scene and rosbag2 are imported when they are first used, because detectors need neither.

>>> from qflsd_ros.sources import Scene
>>> image, truth = Scene(160, 120, lam=-0.3).frame(0)
>>> image.shape
(120, 160)
"""
from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from qflsd_ros.sources.frames import Frame, Source, SourceError

if TYPE_CHECKING:
    from qflsd_ros.sources.opening import open_source
    from qflsd_ros.sources.scene.scene import Scene, SceneFrames

__all__ = ['Frame', 'open_source', 'Scene', 'SceneFrames', 'Source', 'SourceError']
_LATE = {'open_source': 'opening', 'Scene': 'scene.scene', 'SceneFrames': 'scene.scene'}


def __getattr__(name: str) -> object:
    """Import the module of a name that is used for the first time."""
    if name not in _LATE:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_LATE[name]}'), name)
