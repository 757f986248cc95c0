"""Every page in every language, with an entry of the operator's log for every act of every table."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, get_args

import pytest

from app.cell.alarms.sources import PRIORITIES
from app.cell.commands.alarm_acts import ALARM_ACTS
from app.cell.commands.control_acts import CONTROL_ACTS, HAND_OVERS
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.cell.commands.machine_acts import MACHINE_ACTS
from app.cell.commands.recipe_acts import RECIPE_ACTS
from app.cell.commands.shift_acts import SHIFT_ACTS
from app.cell.commands.user_acts import END, SECRET_DONE, USER_ACTS
from app.cell.people.access import EndReason
from app.cell.people.access_log import (
    CHANGES,
    SIGN_IN_SENTENCES,
    SIGN_OUT_SENTENCES,
    WAITS,
    WRONG,
)
from app.cell.people.secrets_hash import WAYS
from app.cell.permission.roles import ROLE_NAMES
from app.cell.recipes.recipe import Act
from app.cell.view.displays import LAMP_WORDS, SHAPES
from app.cell.view.link_status import PRESENCE_WORDS, RobotPresence
from app.panel.roles import ROLES
from app.records import OperatorLog, Origin, new_entry
from app.records.entry import Entry, Kind
from app.system.texts import say, sentences
from app.web.pages.alarms import SHOW_WORDS, SORT_WORDS, Show, Sort
from app.web.pages.display_choice import CHOICE_WORDS, CHOICES, OPTION_WORDS
from app.web.pages.log_words import ACTION_WORDS, OUTCOME_WORDS
from app.web.pages.recipes_page import ACT_WORDS
from app.web.routes.alarm_history import SPAN_WORDS, SPANS
from app.web.routes.audit_log import ROWS_ON_PAGE
from tests.support.operator_log import run
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready

LANGUAGES: Final = ("en", "de", "ja")
TABLES: Final[dict[Kind, tuple[str, ...]]] = {
    "control": (
        *(f"control_{act}" for act in CONTROL_ACTS),
        *(action for action, *_ in HAND_OVERS.values()),
    ),
    "alarm": (*(f"alarm_{act}" for act in ALARM_ACTS), *(f"alarm_{act}" for act in SHIFT_ACTS)),
    "diagnostics": tuple(f"diagnostics_{act}" for act in {**DIAGNOSTIC_ACTS, **MACHINE_ACTS}),
    "recipe": tuple(f"recipe_{act}" for act in RECIPE_ACTS),
    "access": (
        *(f"users_{act}" for act in {*USER_ACTS, *CHANGES}),
        "sign_in",
        "sign_out",
        "confirm",
    ),
}
PAGES: Final = (
    "/", "/alarms", "/alarms/history", "/alarms/report", "/diagnostics", "/help", "/log",
    "/signin", "/users",
)  # fmt: skip


def entries() -> Iterator[Entry]:
    """An entry of each act, and of each kind with each outcome."""
    origin = Origin(address="10.0.0.7", browser="c0ffee", who="M. Sato")
    for kind, actions in TABLES.items():
        for action in actions:
            reason = say("no_such_sentence", action=action)
            about = {"action": action, "outcome": "accepted"}
            yield new_entry(kind, origin, {"name": "x"}, reason, **about)
    for kind in get_args(Kind):
        for outcome in (*OUTCOME_WORDS, "of_another_version"):
            yield new_entry(kind, origin, {}, "Stored.", action="press", outcome=outcome, widget="stop")


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data: Path = tmp_path_factory.mktemp("data")

    async def fill(log: OperatorLog) -> None:
        for entry in entries():
            log.add(entry)

    run(data, fill)
    more: Any = {"KIOSK_PANEL": str(SHIPPED), "KIOSK_DATA": str(data), "KIOSK_MODE": "demo"}
    with ready(Server(ROOT, **more)) as mine:
        yield mine


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_page_shows_every_entry(cell: Server, language: str) -> None:
    headers = {"accept": "text/html", "accept-language": language}
    for page in PAGES:
        answer = cell.http.get(page, headers=headers, follow_redirects=True)
        assert answer.status_code == 200, (page, answer.text)
    pages, path = 0, "/log?every=true"
    while path:
        answer = cell.http.get(path, headers=headers)
        assert answer.status_code == 200, (path, answer.text)
        pages += 1
        older = answer.text.partition('rel="next" href="')[2].partition('"')[0]
        path = older.replace("&amp;", "&")
    assert (pages - 1) * ROWS_ON_PAGE > sum(map(len, TABLES.values()))
    assert cell.http.get("/log.csv?every=true", headers=headers).status_code == 200
    assert "no sentence in" not in cell.process.text


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_act_end_and_own_alarm_has_its_sentence(language: str) -> None:
    known = sentences(language)
    codes = {ACTION_WORDS[action] for kind in TABLES if kind != "access" for action in TABLES[kind]}
    codes |= {*OUTCOME_WORDS.values()}
    assert USER_ACTS.keys() - {END} <= CHANGES.keys()
    codes |= {sentence for _, sentence in CHANGES.values()}
    codes |= {SIGN_OUT_SENTENCES[reason] for reason in get_args(EndReason)}
    codes |= {*WAITS.values(), *(code for ways in WRONG.values() for code in ways.values())}
    codes |= {name.replace("panel_alarms_", "own_").replace("panel_", "own_") for name in PRIORITIES}
    assert sorted(codes - known.keys()) == []


@pytest.mark.parametrize(
    ("table", "values"),
    [
        (CHOICE_WORDS, [*CHOICES]),
        (OPTION_WORDS, [(name, value) for name, values in CHOICES.items() for value in values]),
        (PRESENCE_WORDS, get_args(RobotPresence)),
        (LAMP_WORDS, [*SHAPES]),
        (ROLE_NAMES, ROLES),
        (SHOW_WORDS, get_args(Show)),
        (SORT_WORDS, get_args(Sort)),
        (SPAN_WORDS, [*SPANS]),
        (ACT_WORDS, get_args(Act)),
        (SECRET_DONE, WAYS),
        (SIGN_IN_SENTENCES, (*WAYS, "oidc")),
    ],
)
def test_every_value_has_its_word(table: Mapping[Any, str], values: Sequence[Any]) -> None:
    assert sorted(table) == sorted(values)
    assert [code for code in table.values() if code not in sentences("en")] == []
