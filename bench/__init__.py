"""`make bench`: this panel and its rivals, measured side by side in one run."""
