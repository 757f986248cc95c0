"""The documentation's site: `make docs`. What its pages take from the code is written before, by
`python -m docs._generate`."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parent.parent

project = "Operator panel"
author = copyright = "the operator panel's authors"
release = version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

extensions = ["myst_parser"]
exclude_patterns = ["_*"]
html_theme = "furo"
html_title = project
html_show_sphinx = False

# Anchors are those that a repository's own view of the pages has.
myst_heading_anchors = 4
nitpicky = True
linkcheck_anchors = True
suppress_warnings: list[str] = []
