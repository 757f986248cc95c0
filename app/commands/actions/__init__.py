"""Action goals: sending, tracking, canceling, and recovery after a restart."""
