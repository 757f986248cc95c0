"""Places on a map that operators save while the panel runs."""
