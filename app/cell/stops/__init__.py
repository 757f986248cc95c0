"""Why the machine stopped: what changed around a stop, and what was first."""
