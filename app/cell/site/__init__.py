"""What a cell tells of itself to walls, and the cells that a wall shows."""
