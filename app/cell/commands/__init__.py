"""Commands, from a press to its receipt: topics, services, actions, parameters, holds. No HTTP, no
Zenoh."""
