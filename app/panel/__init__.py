"""The panel file: TOML in, frozen and checked descriptions out."""

from app.panel.load import load_panel
from app.panel.model import Interlock, Page, Panel, Publish, Readout, TextInput, Widget

__all__ = ["Interlock", "Page", "Panel", "Publish", "Readout", "TextInput", "Widget", "load_panel"]
