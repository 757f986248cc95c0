"""Values of messages, made from their types and what a panel tells of its fields."""
