"""The ROS graph of robots at one moment, as their bridges report it."""
