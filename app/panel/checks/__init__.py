"""Checks of a panel file with valid keys and values, besides those of each widget."""
