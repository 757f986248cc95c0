"""Action goals: sent, tracked to their end, canceled, recovered after a restart."""
