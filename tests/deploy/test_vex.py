"""The VEX file of a release: deploy/vex.py, deploy/vex.toml."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.session.machine_watch import judged, vex_file
from app.system.inventory import Component
from app.system.vex import parse_vex, verdicts
from deploy import release, vex
from deploy.audit import Weakness
from tests.support.signed import Signer

AT: Final = datetime(2026, 11, 30, 12, 0, tzinfo=UTC)
LOCKED: Final = {"pillow": "12.0.0", "uvicorn": "0.38.0"}
JUDGED: Final[dict[str, Any]] = {
    "weakness": "CVE-2026-1",
    "packages": ["pillow"],
    "status": "not_affected",
    "justification": "vulnerable_code_not_in_execute_path",
}
WEAK: Final = Weakness("pillow", "12.0.0", "CVE-2026-1", ("12.0.1",))
OTHER: Final = Weakness("uvicorn", "0.38.0", "CVE-2026-1", ())


def test_a_statement_is_about_the_locked_version_in_this_version_of_the_program() -> None:
    document = vex.document("0.2.0", [JUDGED], LOCKED, AT)
    read = parse_vex(document)
    installed = (Component("operator-panel", "0.2.0"), Component("pillow", "12.0.0"))
    (verdict,) = verdicts(read, installed)
    assert (verdict.weakness, verdict.component.name, verdict.status) == (
        "CVE-2026-1",
        "pillow",
        "not_affected",
    )
    assert verdicts(read, (Component("operator-panel", "0.1.0"), installed[1])) == []
    assert (document["timestamp"], document["version"]) == ("2026-11-30T12:00:00+00:00", 1)


def test_without_statements_the_file_has_its_time_and_version() -> None:
    document = vex.document("0.2.0", [], LOCKED, AT)
    assert parse_vex(document).statements == ()
    assert "0.2.0" in document["author"]


def test_a_package_that_is_not_locked_has_no_statement() -> None:
    with pytest.raises(vex.VexError, match="CVE-2026-1: pillow is not locked"):
        vex.document("0.2.0", [JUDGED], {}, AT)


@pytest.mark.parametrize(
    ("statements", "left"),
    [([], [WEAK, OTHER]), ([JUDGED], [OTHER]), ([JUDGED | {"packages": ["pillow", "uvicorn"]}], [])],
)
def test_each_known_weakness_needs_a_statement(statements: list[Any], left: list[Weakness]) -> None:
    assert vex.unjudged([WEAK, OTHER], statements) == left


def test_the_judgements_of_this_checkout_make_a_file() -> None:
    locked = vex.locked(release.LOCK)
    assert "fastapi" in locked
    parse_vex(vex.document(release.version(), vex.judgements(), locked, AT))


def test_an_unknown_key_is_named(tmp_path: Path) -> None:
    file = tmp_path / "vex.toml"
    file.write_text('[[statement]]\nweakness = "CVE-1"\nreason = "none"\n')
    with pytest.raises(vex.VexError, match="reason is no key of a statement"):
        vex.judgements(file)


# What the audit says, of a tag or not → why there is no release, or "".
AUDITS: Final[dict[str, tuple[list[Weakness], list[str], str | None, str]]] = {
    "nothing known": ([], [], "v1", ""),
    "a weakness that is not judged": ([WEAK], [], None, "does not judge"),
    "no data": ([], ["no network"], None, ""),
    "no data for a tag": ([], ["no network"], "v1", "not known which weaknesses there are: no network"),
}


@pytest.mark.parametrize("case", AUDITS)
def test_a_release_has_a_file_in_which_each_known_weakness_is_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    weak, unchecked, tag, why = AUDITS[case]
    monkeypatch.setattr(release, "audit", lambda _: (weak, unchecked))
    if why:
        with pytest.raises(release.ReleaseError, match=why):
            release.judge(tmp_path, tag)
        return
    file = release.judge(tmp_path, tag)
    assert parse_vex(json.loads(file.read_text())).statements == ()
    assert ("may lack weaknesses" in capsys.readouterr().err) == bool(unchecked)
    assert release.is_of_release(file)


def test_the_panel_finds_the_file_of_the_newest_release(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(release, "audit", lambda _: ([], []))
    folders = [tmp_path / name for name in ("panel", "data", "updates")]
    assert vex_file(folders) is None
    for folder in folders[:2]:
        folder.mkdir()
    file = release.judge(folders[1], None)
    signer = Signer(tmp_path / "keys")
    signer.sign(file)
    assert vex_file(folders) == file
    weaknesses = judged(file, signer.public)
    assert (weaknesses.fault, list(weaknesses.affected), weaknesses.investigated) == ("", [], 0)
    for name in ("operator_panel-0.9.0.vex.json", "operator_panel-0.10.0.vex.json"):
        (folders[0] / name).touch()
    assert vex_file(folders) == folders[0] / "operator_panel-0.10.0.vex.json"
    own = folders[1] / "vex.json"
    own.touch()
    assert vex_file(folders) == own
