"""Schemathesis on a server with users, unauthenticated, as a viewer and as an operator: no error of the
server, and nothing done beyond the role. In the short form what is posted only."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest

from tests.support.form import LONG, several
from tests.support.fuzzed import fuzzed
from tests.support.parts import ROOT, Server
from tests.support.servers import ready
from tests.support.users import add_user, log_rows, token_of
from tests.web.test_roles import PANEL

pytestmark = [pytest.mark.long("random"), pytest.mark.promise("security")]

ROLES: Final = ("viewer", "operator", "engineer")
EXAMPLES: Final = several(6, 40)  # of each operation
SEED: Final = "20261127"
# What the paths may name: without it nearly everything would be 404.
NAMED: Final[dict[str, list[str]]] = {
    "widget": ["halt", "go", "grip", "past"],
    "page": ["work", "setup"],
    "alarm": ["air"],
}
ALARM_ACTS: Final = {("alarm_acknowledge", ""), ("alarm_reset", ""), ("alarm_message", "")}
PERMITTED: Final[dict[str, set[tuple[str, str]]]] = {  # (action, widget) of the operator's log
    "nobody": {("press", "halt")},
    "viewer": {("press", "halt")},
    "operator": {("press", "halt"), ("press", "go"), *ALARM_ACTS},
}


class Users:
    """A server with users, and a token of each role."""

    def __init__(self, folder: Path, server: Server, tokens: dict[str, str]) -> None:
        self.server, self.tokens = server, tokens
        described = self.get("/openapi.json", "engineer").json()
        for operations in described["paths"].values():
            for operation in operations.values():
                for parameter in operation.get("parameters", ()):
                    if parameter["in"] == "path" and parameter["name"] in NAMED:
                        parameter["schema"] = {"enum": NAMED[parameter["name"]]}
        self.described: dict[str, Any] = described
        self.file = folder / "openapi.json"
        self.file.write_text(json.dumps(described))

    def get(self, path: str, role: str) -> httpx.Response:
        headers = {"authorization": f"Bearer {self.tokens[role]}"}
        return self.server.http.get(path, headers=headers).raise_for_status()

    def rows(self) -> list[dict[str, str]]:
        with httpx.Client(base_url=self.server.url, trust_env=False, timeout=20) as engineer:
            engineer.headers["authorization"] = f"Bearer {self.tokens['engineer']}"
            return log_rows(engineer)


@pytest.fixture(scope="module")
def users(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Users]:
    folder = tmp_path_factory.mktemp("roles")
    file = folder / "cell.toml"
    file.write_text(PANEL)
    add_user(folder, "M. Sato", "operator", pin="2580")
    tokens = {role: token_of(folder, f"program {role}", role) for role in ROLES}
    with ready(Server(ROOT, KIOSK_DATA=str(folder), KIOSK_PANEL=str(file))) as server:
        yield Users(folder, server, tokens)


@pytest.mark.parametrize("role", PERMITTED)
def test_no_role_does_more_than_it_may(users: Users, role: str, tmp_path: Path) -> None:
    seen = len(users.rows())
    token = users.tokens.get(role)
    fuzzed(
        str(users.file),
        tmp_path,
        f"--url={users.server.url}",
        "--checks=not_a_server_error,status_code_conformance,content_type_conformance,"
        "response_schema_conformance",
        "--exclude-path-regex=/events$|/robots/",  # which this panel has one of
        f"--max-examples={EXAMPLES}",
        "--phases=fuzzing",
        *([] if LONG else ["--include-method=POST"]),
        f"--seed={SEED}",
        *([f"--header=Authorization: Bearer {token}"] if token else []),
    )
    assert "Traceback" not in users.server.process.text
    rows = [row for row in users.rows()[seen:] if row["address"]]  # not those of clocks
    done_by_it = {(row["action"], row["widget"]) for row in rows if row["outcome"] != "refused"}
    assert done_by_it <= PERMITTED[role]
    assert any(row["outcome"] == "refused" for row in rows)
