"""What the documentation takes from the code. `python -m docs._generate` writes it.

Nothing here needs Sphinx.
"""
