"""(panel, robot, permission) → view → bytes of events, and when to refresh it."""
