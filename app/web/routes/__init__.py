"""HTTP, and nothing but HTTP: each module is a router of one part of the contract."""
