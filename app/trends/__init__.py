"""The history of the fields that trends show: recorded from each sample, and written to disk."""
