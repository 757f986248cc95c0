"""The widgets of a panel file, a module per family."""
