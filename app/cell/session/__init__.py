"""One session per robot, and the fleet. Connects robot, permission, view, commands and transport."""
