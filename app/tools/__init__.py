"""The commands, and what only they use: doctor, simulator, scaffold, install, kiosk."""
