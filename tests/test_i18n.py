"""The sentences: every code that the program uses is there, and ages read as operators say them."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from string import Formatter

import pytest

from app.clock import format_age
from app.i18n import ENGLISH, say
from app.settings import PACKAGE, shipped

SPEAKERS = ("say", "said", "locked", "refused")  # functions whose first argument is a code
PREFIXES = ("control_", "lamp_", "log_page_")  # of codes that are put together


def spoken() -> Iterator[tuple[str, str, frozenset[str]]]:
    """(where, code, names given) of every call in the program that names its code."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text())):
            if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name) or not call.args:
                continue
            code = call.args[0]
            if call.func.id in SPEAKERS and isinstance(code, ast.Constant):
                names = frozenset(k.arg for k in call.keywords if k.arg)
                yield f"{path.name}:{call.lineno}", str(code.value), names


def needed(code: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(ENGLISH[code]) if name}


def test_every_code_that_the_program_says_has_a_sentence() -> None:
    said = list(spoken())
    assert len(said) > 20
    assert [(where, code) for where, code, _ in said if code not in ENGLISH] == []


def test_every_sentence_gets_all_that_it_is_about() -> None:
    # `refused(code, why)` fills in `why` and `time` itself.
    lacking = [
        (where, code) for where, code, names in spoken() if not needed(code) <= names | {"why", "time"}
    ]
    assert lacking == []


def test_every_sentence_is_said_somewhere() -> None:
    sources = [path for path in PACKAGE.rglob("*.py") if path.name != "sentences.py"]
    sources += [path for name in ("templates", "static") for path in shipped(name).rglob("*.*")]
    words = set(re.findall(r"\w+", "\n".join(path.read_text() for path in sources)))
    ends = {code: code.removeprefix(next(filter(code.startswith, PREFIXES), "")) for code in ENGLISH}
    assert [code for code, end in ends.items() if not words & {code, end}] == []


def test_no_sentence_is_said_while_modules_are_imported() -> None:
    """One that is could never be in a reader's language."""
    code = """
import importlib, pkgutil
import app, app.i18n

def say(code, **about):
    raise AssertionError(f"{code} is said at import")

app.i18n.say = say
for module in pkgutil.walk_packages(app.__path__, "app."):
    if not module.name.endswith("__main__") and module.name != "app.main":
        importlib.import_module(module.name)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_a_sentence_is_filled_in() -> None:
    assert say("waiting", topic="/estop") == "Locked: waiting for /estop."


def test_braces_in_what_is_filled_in_are_only_text() -> None:
    assert say("refused", why="{topic}", time="now") == "Not sent at now: {topic}"


def test_an_unknown_code_is_a_mistake_of_the_programmers() -> None:
    with pytest.raises(KeyError):
        say("no such code")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (4.9, "4 s"),
        (59.999, "59 s"),
        (60, "1 min"),
        (3599, "59 min"),
        (3600, "1 h"),
        (360_000, "100 h"),
    ],
)
def test_an_age_reads_as_an_operator_says_it(seconds: float, text: str) -> None:
    assert format_age(seconds) == text
