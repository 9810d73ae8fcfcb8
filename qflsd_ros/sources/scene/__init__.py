"""The synthetic scene, a furnished room: geometry, camera, renderer and exact arcs."""
from qflsd_ros.sources.scene.scene import Scene, SceneFrames

__all__ = ['Scene', 'SceneFrames']
