"""The proof of a panel before delivery: each control in each situation, on a simulated robot."""
