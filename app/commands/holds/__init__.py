"""Hold-to-run: a lease per hold, what it publishes and the receipts of it."""
