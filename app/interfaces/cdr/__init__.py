"""CDR bytes to and from values."""
