"""
Sources of images, independent of ROS: the synthetic scene, files, videos, webcams, rosbag2.

>>> from qflsd_ros.sources import Scene
>>> image, truth = Scene(160, 120, lam=-0.3).frame(0)
>>> image.shape
(120, 160)
"""
from qflsd_ros.sources.frames import Frame, Source, SourceError
from qflsd_ros.sources.opening import open_source
from qflsd_ros.sources.scene.scene import Scene, SceneFrames

__all__ = ['Frame', 'open_source', 'Scene', 'SceneFrames', 'Source', 'SourceError']
