"""Recordings that are played in place of a simulated robot."""
