"""ROS parameters: declaration, files, and those of the node."""
