"""The name by which a watcher that runs since before an update makes its waiting page."""
