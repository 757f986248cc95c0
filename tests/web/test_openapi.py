"""What openapi.json says is what the server does: held against it by hand, and by Schemathesis."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest

from app.web.requests import FORM
from app.web.server import HEAD_MOST
from tests.support.form import LONG, several
from tests.support.fuzzed import fuzzed
from tests.support.parts import REFERENCE, ROOT, Server
from tests.support.servers import ready

CONTROL = "\n[control]\nrequired = true\n"
EXAMPLES = several(3, 20)  # of each operation
# Each a test of its own: all together take longer than a test may. The others try every limit of the
# description: that takes three quarters of the time.
PHASES = ("examples,coverage", "fuzzing", "stateful") if LONG else ("fuzzing",)
SEED = "20261122"


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped one, where browsers take control."""
    path = tmp_path_factory.mktemp("panel") / "panel.toml"
    path.write_text(REFERENCE.read_text() + CONTROL)
    return path


@pytest.fixture(scope="module")
def kiosk(panel: Path) -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(panel))) as mine:
        yield mine


@pytest.fixture(scope="module")
def described(kiosk: Server) -> dict[str, Any]:
    schema: dict[str, Any] = kiosk.http.get("/openapi.json").json()
    return schema


def tables(node: Any) -> Iterator[dict[str, Any]]:
    """Every table in it, itself too."""
    if isinstance(node, dict):
        yield node
    for inner in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from tables(inner)


def test_every_reference_leads_somewhere(described: dict[str, Any]) -> None:
    for table in tables(described):
        assert "$defs" not in table
        if "$ref" in table:
            node = described
            for step in table["$ref"].removeprefix("#/").split("/"):
                node = node[step]


@pytest.mark.parametrize(
    ("method", "path", "statuses"),
    [
        ("get", "/", "200 303 403 404"),
        ("get", "/pages/{page}", "200 303 403 404"),
        ("get", "/events", "200 403 404 422"),
        ("post", "/widgets/{widget}", "200 303 403 404 408 409 413 422 429 503 504"),
        ("post", "/widgets/{widget}/cancel", "200 303 403 404 408 409 413 422 429 503"),
        ("post", "/control/{act}", "200 303 403 404 408 409 413 422"),
        ("post", "/control/here", "204 403 404 408 413 422"),
        ("get", "/readyz", "200 403 503"),
        ("get", "/metrics", "200 403"),
    ],
)
def test_every_status_is_described(
    described: dict[str, Any], method: str, path: str, statuses: str
) -> None:
    responses = described["paths"][path][method]["responses"]
    assert set(statuses.split()) <= set(responses)
    assert "HTTPValidationError" not in str(responses)


def test_a_receipts_code_is_described(described: dict[str, Any]) -> None:
    receipt = described["components"]["schemas"]["ReceiptAnswer"]
    assert receipt["required"] == ["id", "widget", "outcome", "code", "reason", "at"]
    code = receipt["properties"]["code"]
    assert code["anyOf"] == [{"type": "string"}, {"type": "null"}]
    assert "stable name" in code["description"]


def test_metrics_are_text_and_too_many_presses_say_when_to_come_again(
    described: dict[str, Any],
) -> None:
    metrics = described["paths"]["/metrics"]["get"]["responses"]["200"]["content"]
    assert list(metrics) == ["text/plain"]
    press = described["paths"]["/widgets/{widget}"]["post"]
    assert press["responses"]["429"]["headers"]["Retry-After"]["schema"] == {"type": "integer"}
    assert set(press["requestBody"]["content"]) == {
        "application/json",
        "application/x-www-form-urlencoded",
    }


def test_invalid_request_gets_a_regular_error(kiosk: Server) -> None:
    answer = kiosk.http.get("/events?once=perhaps")
    assert answer.status_code == 422
    assert answer.json()["error"].startswith("once: Input should be a valid boolean")


@pytest.mark.parametrize(
    ("path", "fields", "status"),
    [
        ("/alarms/report", {}, 303),
        ("/alarms/drive/shelve", {"for_s": "", "occurrence": "", "_since": ""}, 303),
        ("/alarms/acknowledge", {"id": "", "page": "", "_since": ""}, 303),
        ("/alarms/acknowledge", {"other": ""}, 422),
        ("/users/remove", {"name": "nobody", "version": "", "_since": ""}, 303),
        ("/users/remove", {"name": "nobody", "_since": "nan"}, 422),
        ("/control/take", {"id": "", "to": "", "page": ""}, 303),
    ],
)
def test_an_empty_field_of_a_form_is_none(
    kiosk: Server, path: str, fields: dict[str, str], status: int
) -> None:
    content = urlencode(fields)
    answer = kiosk.http.post(path, content=content, headers={"content-type": FORM})
    assert answer.status_code == status, answer.text


def test_a_number_is_no_time(kiosk: Server) -> None:
    assert kiosk.http.get("/alarms?until=0.5").status_code == 422
    assert kiosk.http.post("/alarms/drive/acknowledge", json={"at": 5}).status_code == 422
    assert kiosk.http.get("/alarms?until=2026-11-21T10:00:00Z").status_code == 200


def test_a_request_over_a_limit_is_described(described: dict[str, Any]) -> None:
    """As the error of a limit of all requests; an act as a receipt too."""
    for path, methods in described["paths"].items():
        for method, operation in methods.items():
            limited = str(operation["responses"]["429"])
            assert "ErrorAnswer" in limited, (method, path)
            if method == "post" and "Receipt" in str(operation["responses"].get("200", "")):
                assert "Receipt" in limited, path


def test_the_longest_return_of_a_provider_is_no_request_too_long(described: dict[str, Any]) -> None:
    back = described["paths"]["/session/oidc/back"]["get"]["parameters"]
    texts = [parameter["schema"] for parameter in back if parameter["schema"]["type"] == "string"]
    assert all(text["pattern"] == r"^[\x20-\x7e]*$" for text in texts)
    assert sum(3 * text["maxLength"] for text in texts) < HEAD_MOST


@pytest.mark.long("random")
@pytest.mark.parametrize("phases", PHASES)
def test_schemathesis_finds_nothing(
    kiosk: Server, described: dict[str, Any], phases: str, tmp_path: Path
) -> None:
    """All of its checks, on everything but the stream that never ends."""
    printed = fuzzed(
        f"{kiosk.url}/openapi.json",
        tmp_path,
        "--checks=all",
        "--exclude-path-regex=/events$",
        f"--max-examples={EXAMPLES}",
        f"--phases={phases}",
        f"--seed={SEED}",
    )
    operations = [path for path, methods in described["paths"].items() for _ in methods]
    tried = [path for path in operations if not path.endswith("/events")]
    assert f"Selected: {len(tried)}/{len(operations)}" in printed
    assert "Traceback" not in kiosk.process.text
