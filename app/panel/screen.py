"""The table `[screen]` of a panel file: how the touch screen behaves between presses."""

from typing import Annotated, Final, Literal

from pydantic import Field

from app.panel.base import Description

Keyboard = Literal["auto", "on", "off"]

CLEANING_S: Final = 30  # how long the screen is locked to be cleaned


class ScreenRules(Description):
    """After `dim_after_s` seconds without a touch the page gets dark; 0: never. `kiosk`: where a finger
    is the main pointer, the browser's own gestures are off. `sounds`: a refused press sounds, unless it
    is turned off in the browser."""

    dim_after_s: Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)] = 0.0
    kiosk: bool = True
    sounds: bool = False
