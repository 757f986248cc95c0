"""The commands that look at a running robot, through its bridge and without ROS."""
