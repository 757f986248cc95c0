"""The editor of panel files: `operator-panel edit`."""
