"""The demo robot: a Zenoh peer that knows nothing of the server."""
