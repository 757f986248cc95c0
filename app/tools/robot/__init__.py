"""A robot as the tools read it, beside a panel's server or without one."""
