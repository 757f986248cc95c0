"""The operating system: shutdown, listening sockets, the service manager, memory."""
