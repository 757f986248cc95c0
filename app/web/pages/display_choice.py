"""The look of a browser's pages: chosen in that browser, else the panel file's."""

from collections.abc import Mapping
from typing import Final, NamedTuple, TypedDict, get_args

from app.panel.layout import Hand, TextSize, Theme
from app.panel.model import Panel
from app.system.texts import TextLike, say
from app.system.texts.locales import own_name

# Each choice by its name, a key of the panel file or of its [screen]: its cookie is kiosk_<name>.
CHOICES: Final = {
    "theme": get_args(Theme),
    "text_size": get_args(TextSize),
    "hand": get_args(Hand),
    "sounds": ("off", "on"),
}
CHOICE_WORDS: Final = {
    "theme": "display_theme",
    "text_size": "display_text_size",
    "hand": "display_hand",
    "sounds": "display_sounds",
}
OPTION_WORDS: Final = {
    ("theme", "light"): "display_theme_light",
    ("theme", "dark"): "display_theme_dark",
    ("theme", "contrast"): "display_theme_contrast",
    ("text_size", "normal"): "display_text_size_normal",
    ("text_size", "large"): "display_text_size_large",
    ("hand", "right"): "display_hand_right",
    ("hand", "left"): "display_hand_left",
    ("sounds", "off"): "display_sounds_off",
    ("sounds", "on"): "display_sounds_on",
}
COOKIE: Final = "kiosk_{}"
FONTS: Final = ("kiosk_fonts", "kept")  # a browser that has the shipped fonts, by static/js/main.js
LANGUAGE: Final = "language"
KEPT_S: Final = 400 * 86400  # as long as browsers keep a cookie


class DisplaySettings(NamedTuple):
    """The values of a page's root element. `fonts` is "kept" if the browser has the shipped fonts."""

    theme: str
    text_size: str
    hand: str
    sounds: str
    fonts: str


class Option(TypedDict):
    """One value of a choice, in the menu; `lang` is the language of its label, "" for the page's."""

    value: str
    label: TextLike
    chosen: bool
    lang: str


class Choice(TypedDict):
    """A choice, in the menu."""

    name: str
    label: TextLike
    options: list[Option]


def display_of(cookies: Mapping[str, str], panel: Panel) -> DisplaySettings:
    """The look of the pages of a browser with these cookies."""
    cookie, kept = FONTS
    fonts = kept if cookies.get(cookie) == kept else ""
    return DisplaySettings(**{name: _chosen(cookies, panel, name) for name in CHOICES}, fonts=fonts)


def _chosen(cookies: Mapping[str, str], panel: Panel, name: str) -> str:
    choice = cookies.get(COOKIE.format(name), "")
    return choice if choice in CHOICES[name] else _usual(panel, name)


def _usual(panel: Panel, name: str) -> str:
    if name == "sounds":
        return "on" if panel.screen.sounds else "off"
    usual: str = getattr(panel, name)
    return usual


def language_choice(panel: Panel, now: str) -> list[Choice]:
    """The choice of a language, each with its own name; empty if the panel has one only."""
    tags = panel.readers_languages
    options = [Option(value=tag, label=own_name(tag), chosen=tag == now, lang=tag) for tag in tags]
    return [Choice(name=LANGUAGE, label=say("display_language"), options=options)] if tags[1:] else []


def choices(now: DisplaySettings) -> list[Choice]:
    """The choices of the menu, with what is chosen."""
    return [
        Choice(
            name=name,
            label=say(CHOICE_WORDS[name]),
            options=[
                Option(
                    value=choice,
                    label=say(OPTION_WORDS[name, choice]),
                    chosen=choice == getattr(now, name),
                    lang="",
                )
                for choice in values
            ],
        )
        for name, values in CHOICES.items()
    ]
