"""An operator's touch panel for ROS 2 robots, over Zenoh."""
