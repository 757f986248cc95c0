"""One session per robot, and the fleet: wires robot, permission, view, commands and transport."""
