"""proxcgal as ROS 2 nodes."""
