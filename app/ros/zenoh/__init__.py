"""The Zenoh session: samples, liveliness tokens, queries. It depends on no panel."""
