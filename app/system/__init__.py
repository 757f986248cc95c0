"""What every room may use: texts, clock, disk, settings, logging, certificates, processes."""
