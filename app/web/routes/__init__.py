"""The HTTP routes: each module is a router of one part of the contract."""
