"""The forwarder: sends what the cell keeps to the plant's PostgreSQL, in a process beside the
server."""
