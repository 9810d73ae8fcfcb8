"""
Start the detector, and optionally RViz: ``ros2 launch qflsd_ros detector.launch.py``.

``--show-args`` lists the arguments.  Nothing else in the package depends on this file:
``ros2 run qflsd_ros detector`` starts the same node.
"""
from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NAME = 'detector'
RESPAWN_DELAY = 2.0  # s, in which discovery forgets the old node; also limits the log


def config(name: str) -> PathJoinSubstitution:
    """Return the path of an installed configuration file."""
    return PathJoinSubstitution([FindPackageShare('qflsd_ros'), 'config', name])


def arguments() -> list[DeclareLaunchArgument]:
    """Return the arguments of this launch file, in the order in which they are listed."""
    switch = ['true', 'false']
    return [
        DeclareLaunchArgument(
            'image', default_value='image',
            description='Topic of the images; camera_info is expected in the same namespace.'),
        DeclareLaunchArgument(
            'params_file', default_value=config('detector.yaml'),
            description='YAML file with parameters of the detector.'),
        DeclareLaunchArgument(
            'namespace', default_value='',
            description='Namespace of the node, and of the image topic unless it begins with /.'),
        DeclareLaunchArgument(
            'rviz', default_value='false', choices=switch,
            description='Also start RViz (package rviz2) with overlay and markers.'),
        DeclareLaunchArgument(
            'respawn', default_value='false', choices=switch,
            description=f'Start the detector again, {RESPAWN_DELAY:g} s later, when it ends.')]


def detector() -> Node:
    """Return the detector, configured by the arguments."""
    return Node(
        package='qflsd_ros', executable='detector', name=NAME,
        namespace=LaunchConfiguration('namespace'),
        parameters=[LaunchConfiguration('params_file')],
        remappings=[('image', LaunchConfiguration('image'))],
        respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY, output='screen')


def rviz() -> Node:
    """Return RViz, whose topics in the root namespace are remapped to those of the detector."""
    topics = [f'/{NAME}/{name}' for name in ('overlay', 'markers')]
    return Node(
        package='rviz2', executable='rviz2', arguments=['-d', config('qflsd.rviz')],
        remappings=[(topic, [LaunchConfiguration('namespace'), topic]) for topic in topics],
        condition=IfCondition(LaunchConfiguration('rviz')), output='screen')


def generate_launch_description() -> LaunchDescription:
    """Return the description that ``ros2 launch`` executes."""
    return LaunchDescription([*arguments(), detector(), rviz()])
