"""The CDR codec: bytes to and from values."""
