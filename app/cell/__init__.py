"""The panel at one cell: its robots, its users, what they may do and have done, and what pages show."""
