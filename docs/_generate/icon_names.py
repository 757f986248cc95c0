"""The names in docs/reference/icons.md, those of the icons that are shipped."""

from app.system.pictures import icons


def icon_list() -> str:
    """The names, in their order."""
    return ", ".join(f"`{name}`" for name in sorted(icons()))
