"""The parameters of a robot's nodes: read, kept up to date, set."""
