"""The parameters of a robot's nodes: reading, updates by events, setting."""
