"""How ROS 2 names become Zenoh key expressions and back, for each kind of way to a robot. No I/O."""
