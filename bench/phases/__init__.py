"""The phases of `make bench`: a module measures one phase, or both directions of latency."""
