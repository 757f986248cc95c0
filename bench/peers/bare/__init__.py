"""The floors of `bench.light`: the least that a page, a press and a topic cost with these libraries."""
