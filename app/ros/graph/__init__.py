"""A survey of robots: the ROS graph of each at one moment, as their peers report it."""
