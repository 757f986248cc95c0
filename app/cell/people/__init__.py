"""Who a client is: users, roles, sign-in, sessions and tokens of programs."""
