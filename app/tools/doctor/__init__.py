"""What is wrong between a panel file, this machine and a robot, found without a running server."""
