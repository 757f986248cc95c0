"""Faults of a panel file: found in its text and its shape, told once, each with its line."""
