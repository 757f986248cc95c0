"""An empty panel file, and a page of another one with all that it names."""

import tomllib
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.file.load import faults_of_text
from app.system.settings import PACKAGE
from app.tools.editor.document import Document, EditError
from app.tools.editor.references import owners, references
from app.tools.editor.starting import empty_text, page_edits
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("panel file")

EXAMPLES: Final = ROOT / "docs/examples"
OTHER: Final = """\
title = "Other"
access.groups = ["fitters", "painters"]

# Permits it.
[[interlock]]
id = "ready"
robot = "left"
source = "state"

[[interlock]]
id = "shared"
topic = "/shared"

[[source]]
id = "state"
topic = "/state"

[[robot]]
id = "left"

[[page]]
id = "first"
title = "First"

[[page.widget]]
id = "speed"
kind = "number"

# The page that is brought.
[[page]]
id = "cell"
title = "Cell"
needs = "fitters"

[[page.group]]
title = "Group"

[[page.group.widget]]
id = "start" # starts
kind = "publish"
interlock = ["ready", "shared"]
message = { data = "{speed}" }

[[page.group.widget]]
same = "speed"
span = 3
"""
TARGET: Final = """\
title = "Target"

[[interlock]]
id = "ready"
topic = "/other"

[[interlock]]
id = "shared"
topic = "/shared"

[[page]]
id = "cell"
title = "Mine"

[[page.widget]]
id = "start"
kind = "call"
"""


@pytest.mark.parametrize("title", ["Cell", 'Zelle "7" \\ ä'])
def test_an_empty_file_has_a_title_and_a_page(title: str, tmp_path: Path) -> None:
    text = empty_text(title)
    tables = tomllib.loads(text)
    assert (tables["title"], tables["page"][0]["title"]) == (title, title)
    assert faults_of_text(text, tmp_path) == ()


def test_a_page_brings_what_it_names_under_ids_that_are_free() -> None:
    document = Document(TARGET)
    document.apply(page_edits(document, Document(OTHER), ("page", 1)), "page")
    tables = document.tables
    assert tables == tomllib.loads(document.text)
    assert tables["access"]["groups"] == ["fitters"]
    assert tables["interlock"] == [
        *tomllib.loads(TARGET)["interlock"],
        {"id": "ready_2", "robot": "left", "source": "state"},
    ]
    assert tables["source"] == [{"id": "state", "topic": "/state"}]
    assert tables["robot"] == [{"id": "left"}]
    mine, brought = tables["page"]
    assert mine == tomllib.loads(TARGET)["page"][0]
    start, speed = brought["group"][0]["widget"]
    assert (brought["id"], start["id"], start["interlock"]) == (
        "cell_2",
        "start_2",
        ["ready_2", "shared"],
    )
    assert speed == {"id": "speed", "kind": "number", "span": 3}
    assert start["message"] == {"data": "{speed}"}
    assert "# The page that is brought.\n[[page]]\n" in document.text
    assert 'id = "start_2" # starts' in document.text
    assert "# Permits it.\n[[interlock]]\n" in document.text
    assert document.text.startswith('title = "Target"\n')
    document.undo()
    assert document.text == TARGET


def test_a_page_that_is_not_there_is_refused() -> None:
    for path in (("page", 7), ("interlock", 0), ()):
        with pytest.raises(EditError):
            page_edits(Document(TARGET), Document(OTHER), path)


@pytest.mark.parametrize(
    "file", [PACKAGE / "panel.toml", EXAMPLES / "palletizer.toml", EXAMPLES / "mobile-robot/panel.toml"]
)
def test_each_page_of_the_shipped_files_comes_into_another_file_twice(file: Path) -> None:
    other = Document(file.read_text())
    for number, page in enumerate(other.tables["page"]):
        document = Document(empty_text("New"))
        for _ in range(2):
            document.apply(page_edits(document, other, ("page", number)), "page")
        assert document.tables == tomllib.loads(document.text)
        assert [len(p.get("group", ())) for p in document.tables["page"][1:]] == [
            len(page.get("group", ()))
        ] * 2
        groups = [(owner.group, owner.id) for owner in owners(document.tables)]
        assert len(groups) == len(set(groups))
        assert dangling(document.tables) <= dangling(other.tables) | {"page"}


def dangling(tables: dict[str, Any]) -> set[str]:
    """What is named and not there, by what it is."""
    known = {(owner.group, owner.id) for owner in owners(tables)}
    return {
        str(groups[0])
        for reference, groups in references(tables)
        if reference.form == "id" and not any((group, reference.text) in known for group in groups)
    } - {"role"}
