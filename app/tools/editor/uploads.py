"""Files that a panel file names, such as pictures and templates: stored beside it if the panel's own
checks take them."""

import os
import re
from pathlib import Path as FilePath
from typing import Final

from app.panel.file.keys import place_of
from app.panel.file.load import faults_of_text
from app.panel.file.toml_lines import Path
from app.system.errors import InputError
from app.system.pictures import PICTURE
from app.system.texts import say
from app.tools.editor.document import Change, Document, Edit, SetValue
from app.tools.editor.editor import Editor

NAME: Final = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_. -]{0,99}")
PICTURES: Final = "pictures"  # the key of the folder, and its name where the file has none
PICTURE_KEYS: Final = ("src", "picture", "logo")
MOST_BYTES: Final = 8_000_000


def store(editor: Editor, path: Path, name: str, data: bytes, author: str = "") -> Change:
    """Writes a file below the panel file's folder and names it at `path`, as one step. InputError for a
    name that no file of a panel has, for another file of this name, and with the panel's own sentence
    for a file that can't be used there; nothing is changed then."""
    is_picture = path[-1] in PICTURE_KEYS or (len(path) > 1 and path[-2] in PICTURE_KEYS)
    if not re.fullmatch(PICTURE if is_picture else NAME, name) or len(data) > MOST_BYTES:
        raise InputError(
            say("form_file_name" if len(data) <= MOST_BYTES else "form_file_large", name=name)
        )
    folder = editor.session.path.parent
    edits: list[Edit] = []
    if is_picture:
        named = editor.document.tables.get(PICTURES)
        if not isinstance(named, str):
            named = PICTURES
            edits.append(SetValue((PICTURES,), named))
        folder /= named
    edits.append(SetValue(path, name))
    file = folder / name
    is_new = not file.exists()
    if not is_new and file.read_bytes() != data:
        raise InputError(say("form_file_exists", name=name))
    made_folder = is_picture and not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
        if is_new:
            _write(file, data)
        trial = Document(editor.document.text)
        trial.apply(edits, "")
        place = place_of(path)
        for fault in faults_of_text(trial.text, editor.session.path.parent):
            if fault.place == place or fault.place == PICTURES:
                raise InputError(fault.message)
    except (InputError, OSError) as error:
        if is_new:
            file.unlink(missing_ok=True)
        if made_folder:
            folder.rmdir()
        if isinstance(error, OSError):
            raise InputError(say("editor_not_saved", why=error.strerror or str(error))) from error
        raise
    return editor.apply(edits, name, author=author)


def _write(file: FilePath, data: bytes) -> None:
    with file.open("xb") as new:
        new.write(data)
        new.flush()
        os.fsync(new.fileno())
