"""The fault suite: what breaks, what the kiosk shows meanwhile, and what the robot received."""
