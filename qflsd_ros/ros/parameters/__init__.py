"""ROS parameters: the settings of the node, their declaration, and parameter files."""
