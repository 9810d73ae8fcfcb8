"""The commands: detect (files, without ROS) and demo (a first look, live)."""
