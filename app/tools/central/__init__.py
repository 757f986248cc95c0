"""The central database: its schema in files of SQL, verification and pruning."""
