"""Recipes: named sets of values of inputs, kept on the panel with their history."""
