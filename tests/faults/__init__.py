"""The fault suite: breaks a part, and checks what the panel shows and what the robot receives."""
