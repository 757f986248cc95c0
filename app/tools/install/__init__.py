"""Installing on a kiosk PC: a plan is a list of steps, each of which can be described, done and undone.

It reads nothing but Python's own library, so that it runs from the wheel's file before anything else is
installed.
"""
