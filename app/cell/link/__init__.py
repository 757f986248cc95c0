"""The Zenoh session and what goes through it: tokens, the graph, liveness, /rosout."""
