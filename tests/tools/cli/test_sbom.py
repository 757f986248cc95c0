"""`operator-panel sbom` and `--check`."""

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from app.system.inventory import system_packages
from app.tools.cli.command import main
from tests.support.signed import Signer
from tests.system.test_vex import document, product, statement

FASTAPI = f"pkg:pypi/fastapi@{version('fastapi')}"


@pytest.fixture
def signer(tmp_path: Path) -> Signer:
    return Signer(tmp_path / "keys")


def vex(folder: Path, *statements: Any) -> Path:
    file = folder / "vex.json"
    file.write_text(json.dumps(document(*statements)))
    return file


def affected(folder: Path) -> Path:
    inner = product("pkg:pypi/operator-panel", FASTAPI)
    return vex(folder, statement("affected", inner, action_statement="Update to 0.2.1."))


def test_it_prints_the_sbom_or_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sbom"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert FASTAPI in [component["purl"] for component in printed["components"]]
    file = tmp_path / "sbom.json"
    assert main(["sbom", "-o", str(file)]) == 0
    assert json.loads(file.read_text()) == printed
    assert main(["sbom", "-o", str(file)]) == 2
    assert "exists" in capsys.readouterr().err


def test_packages_of_the_system_can_be_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    kinds: list[set[str]] = []
    for options in ([], ["--python-only"]):
        assert main(["sbom", *options]) == 0
        printed = json.loads(capsys.readouterr().out)
        kinds.append({each["purl"].partition("/")[0] for each in printed["components"]})
    own = {"pkg:pypi", "pkg:generic"}
    assert kinds == [own | ({"pkg:deb"} if system_packages() else set()), own]


def test_what_is_affected_ends_with_1_and_says_what_to_do(
    tmp_path: Path, signer: Signer, capsys: pytest.CaptureFixture[str]
) -> None:
    file = affected(tmp_path)
    signer.sign(file, comment="VEX of 0.2.0")
    check = ["sbom", "--check", str(file), "--key", str(signer.public)]
    assert main(check) == 1
    said = capsys.readouterr().out
    assert "vex.json is signed with the key " in said
    assert f"CVE-2026-1 in fastapi {version('fastapi')}: Update to 0.2.1." in said
    assert said.rstrip().endswith("about what is installed: 1 affected")
    assert main([*check, "--json"]) == 1
    (verdict,) = json.loads(capsys.readouterr().out)["verdicts"]
    assert (verdict["component"], verdict["status"]) == (FASTAPI, "affected")


@pytest.mark.parametrize("status", ["fixed", "under_investigation", "not_affected"])
def test_nothing_affected_ends_with_0(tmp_path: Path, signer: Signer, status: str) -> None:
    more = {"justification": "vulnerable_code_not_present"} if status == "not_affected" else {}
    file = vex(tmp_path, statement(status, product(FASTAPI), **more))
    signer.sign(file)
    assert main(["sbom", "--check", str(file), "--key", str(signer.public)]) == 0


def test_without_a_signature_that_fits_it_ends_with_2(
    tmp_path: Path, signer: Signer, capsys: pytest.CaptureFixture[str]
) -> None:
    file = affected(tmp_path)
    check = ["sbom", "--check", str(file), "--key", str(signer.public)]
    assert main(check) == 2
    assert "is not signed" in capsys.readouterr().err
    Signer(tmp_path / "others").sign(file)
    assert main(check) == 2
    assert "is signed with the key" in capsys.readouterr().err
    signer.sign(file)
    file.write_text(file.read_text().replace("0.2.1", "0.2.2"))
    assert main(check) == 2
    assert "it was changed" in capsys.readouterr().err
    assert main([*check, "--unsigned"]) == 1
    assert main(["sbom", "--check", str(file), "--key", str(tmp_path / "none")]) == 2
    assert "no key is trusted" in capsys.readouterr().err
