"""ROS 2 without ROS: messages, CDR, names in Zenoh, graph, Zenoh session. It depends on no panel."""
