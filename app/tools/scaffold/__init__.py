"""A first panel file for a robot, from its ROS graph. Pure."""
