"""Checks of texts in several languages: each language has a catalogue, each text each language."""

from collections.abc import Iterator

from app.errors import Fault, Note
from app.i18n.catalogue import files
from app.panel.faults.wording import list_names
from app.panel.model import Panel
from app.panel.texts import panel_texts


def language_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of languages that no reader can choose, and of texts that the panel's own lacks."""
    if panel.languages and panel.language not in panel.languages:
        message = f'lacks the panel\'s own language, "{panel.language}"'
        yield Fault("languages", message, cause="language")
    for place, text in panel_texts(panel):
        for tag in text.texts:
            if tag not in files():
                message = f"is no language with a catalogue; there is {list_names(files())}"
                yield Fault(f"{place}.{tag}", message)
        if panel.language not in text.texts:
            message = f'has no text in the panel\'s language: add {panel.language} = "…"'
            yield Fault(place, f"{message}, or set `language` of the panel to another one")


def untranslated_notes(panel: Panel) -> Iterator[Note]:
    """Texts that lack a language that other texts of the panel have. A text that is no table is meant
    to be the same in every language."""
    texts = list(panel_texts(panel))
    known = {tag for _, text in texts for tag in text.texts}
    wanted = sorted(known & set(panel.languages) if panel.languages else known)
    for place, text in texts:
        if missing := [tag for tag in wanted if tag not in text.texts]:
            named = " and no ".join(missing)
            yield Note(place, f'has no {named}; it is shown in "{panel.language}"')
