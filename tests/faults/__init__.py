"""The fault suite: what breaks, what the kiosk shows in the meantime, and what the robot received."""
