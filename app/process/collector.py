"""Python's garbage collector is off while the server's modules are read, which import this one first.

What they make stays as long as the process does: to look through it again and again takes a twelfth of
the start, and later some ten milliseconds in which nothing is shown.
"""

import gc

gc.disable()


def resume() -> None:
    """Collects again from now on, and never looks at what is there already."""
    gc.freeze()
    gc.enable()
