"""The CDR codec: bytes to and from values."""

# The definitions come first: their registry reads the codec, which reads them.
from app.ros import messages as messages
