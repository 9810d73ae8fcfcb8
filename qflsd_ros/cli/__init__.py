"""The commands ``detect`` (files, without ROS) and ``demo`` (camera and detector, live)."""
