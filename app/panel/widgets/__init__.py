"""The widgets of a panel file, one module for each family."""
