"""X.509 certificates: a small plant CA, those of Zenoh and of the server, and when they run out. It
knows no panel, no Zenoh and no HTTP."""
