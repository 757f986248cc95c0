"""Values of messages, made from their types and what a panel says of its fields."""
