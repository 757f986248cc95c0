"""Faults of a panel file's text, keys and values: reported once, each with its line."""
