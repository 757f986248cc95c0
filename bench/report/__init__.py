"""The results of a run: statistics, the file, targets, tables and a picture."""
