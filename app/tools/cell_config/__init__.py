"""The configurations of a cell's bridges and routers, which commands write from a panel file."""
