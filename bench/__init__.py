"""`make bench`: measures this panel and its rivals side by side in one run."""
