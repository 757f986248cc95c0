"""Signatures of wheels, made by the real minisign: what fits is taken, anything else is refused."""

import base64
import builtins
import subprocess
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from app.system.errors import SettingsError
from app.system.minisign import (
    PINNED,
    SIGNATURE_SUFFIX,
    PublicKey,
    check_signed,
    parse_keys,
    parse_signature,
)
from app.tools.cli.command import main
from app.tools.cli.update import signed_copy
from app.tools.install.host import Host
from deploy import release
from tests.tools.install.test_plan import make_wheel

pytestmark = pytest.mark.usefixtures("minisign")


class Signer:
    """A key pair of minisign, without a password."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.public, self.secret = folder / "minisign.pub", folder / "minisign.key"
        self._run("-G", "-W", "-p", str(self.public), "-s", str(self.secret))

    def sign(self, path: Path, *options: str, comment: str = "0.2.0 for cell 1") -> Path:
        self._run("-S", "-s", str(self.secret), "-m", str(path), "-t", comment, *options)
        return path.with_name(path.name + SIGNATURE_SUFFIX)

    @property
    def text(self) -> str:
        return self.public.read_text()

    @staticmethod
    def _run(*arguments: str) -> None:
        subprocess.run(["minisign", *arguments], check=True, capture_output=True, input=b"\n\n")


@pytest.fixture
def signer(tmp_path: Path) -> Signer:
    return Signer(tmp_path / "keys")


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    return make_wheel(tmp_path / "new", "0.2.0")


def check(wheel: Path, *signers: Signer) -> str:
    return check_signed(wheel, parse_keys("".join(each.text for each in signers), "keys"))


def test_control_characters_of_a_comment_are_printed_as_escapes(signer: Signer, wheel: Path) -> None:
    signer.sign(wheel, comment="0.2.0 \x1b[2Kgood \x08\u202etxt")
    assert check(wheel, signer).endswith(": 0.2.0 good \\u0008\\u202etxt")


def test_a_signature_of_minisign_fits(signer: Signer, wheel: Path) -> None:
    signer.sign(wheel)
    said = check(wheel, signer)
    assert said.endswith(": 0.2.0 for cell 1")
    assert said.split(": ")[0].rpartition(" ")[2] in signer.text  # the key's name in its comment


def test_a_key_is_named_as_minisign_names_it(signer: Signer) -> None:
    (key,) = parse_keys(signer.text, "keys")
    begins_with_zeros = PublicKey(bytes.fromhex("0a296e989478660c"), key.key)
    assert signer.text.splitlines()[0].endswith(f" {key.name}")
    assert begins_with_zeros.name == "C667894986E290A"


def test_of_several_keys_one_has_to_fit(signer: Signer, wheel: Path, tmp_path: Path) -> None:
    signer.sign(wheel)
    assert check(wheel, Signer(tmp_path / "other"), signer)


def changed_wheel(wheel: Path, signature: Path) -> None:
    wheel.write_bytes(wheel.read_bytes() + b"\0")


def changed_comment(wheel: Path, signature: Path) -> None:
    signature.write_text(signature.read_text().replace("for cell 1", "for cell 2"))


def changed_bytes(wheel: Path, signature: Path) -> None:
    lines = signature.read_text().split("\n")
    data = bytearray(base64.b64decode(lines[1]))
    data[20] ^= 1
    lines[1] = base64.b64encode(data).decode()
    signature.write_text("\n".join(lines))


def cut_off(wheel: Path, signature: Path) -> None:
    signature.write_text(signature.read_text()[:120])


def of_another_file(wheel: Path, signature: Path) -> None:
    other = make_wheel(wheel.parent / "x", "0.1.0", **{"zenoh.json5": "{}"})
    wheel.write_bytes(other.read_bytes())


def emptied(wheel: Path, signature: Path) -> None:
    signature.write_text("")


def binary(wheel: Path, signature: Path) -> None:
    signature.write_bytes(b"\xff\xfe")


@pytest.mark.parametrize(
    ("attack", "why"),
    [
        (changed_wheel, "is not what was signed"),
        (of_another_file, "is not what was signed"),
        (changed_bytes, "is not what was signed"),
        (changed_comment, "its comment is another"),
        (cut_off, "is not a signature of minisign"),
        (emptied, "is not a signature of minisign"),
        (binary, "can't be read"),
        (lambda wheel, signature: signature.unlink(), "is not signed"),
    ],
)
def test_attack_something_else_is_not_taken(
    signer: Signer, wheel: Path, attack: Callable[[Path, Path], object], why: str
) -> None:
    attack(wheel, signer.sign(wheel))
    with pytest.raises(SettingsError, match=why):
        check(wheel, signer)


def test_attack_a_key_that_is_not_trusted(signer: Signer, wheel: Path, tmp_path: Path) -> None:
    other = Signer(tmp_path / "other")
    signer.sign(wheel)
    with pytest.raises(SettingsError, match=r"is signed with the key [0-9A-F]{1,16}; trusted is"):
        check(wheel, other)


def test_attack_another_key_with_the_name_of_the_trusted_one(
    signer: Signer, wheel: Path, tmp_path: Path
) -> None:
    """The name of a key is no proof: anyone can write it into a signature."""
    other = Signer(tmp_path / "other")
    lines = other.sign(wheel).read_text().split("\n")
    data = base64.b64decode(lines[1])
    (trusted,) = parse_keys(signer.text, "keys")
    lines[1] = base64.b64encode(data[:2] + trusted.id + data[10:]).decode()
    wheel.with_name(wheel.name + SIGNATURE_SUFFIX).write_text("\n".join(lines))
    with pytest.raises(SettingsError, match="is not what was signed"):
        check(wheel, signer)


def test_the_old_kind_of_signature_is_refused(signer: Signer, wheel: Path) -> None:
    signer.sign(wheel, "-l")
    with pytest.raises(SettingsError, match="without -l"):
        check(wheel, signer)


@pytest.mark.parametrize("text", ["", "untrusted comment: x\n", "garbage\n", "RWQ=\n"])
def test_what_is_no_key_is_said(text: str) -> None:
    with pytest.raises(SettingsError, match="public key"):
        parse_keys(text, "minisign.pub")


def test_a_signature_with_the_lines_of_windows_is_read(signer: Signer, wheel: Path) -> None:
    text = signer.sign(wheel).read_text()
    assert parse_signature(text.replace("\n", "\r\n"), "x") == parse_signature(text, "x")


def pinned(root: Path, text: str) -> Host:
    root.mkdir()
    host = Host(root)
    host.files.write(PINNED, text.encode())
    return host


def test_an_update_takes_a_copy_of_the_signed_wheel(
    signer: Signer, wheel: Path, tmp_path: Path
) -> None:
    """The copy can't be changed between the check and the installation."""
    signer.sign(wheel)
    content = wheel.read_bytes()
    with signed_copy(wheel, pinned(tmp_path / "root", signer.text), unsigned=False) as copy:
        wheel.write_bytes(b"other")
        assert copy.read_bytes() == content
        assert copy.name == wheel.name
    assert not copy.exists()


def test_an_update_without_a_pinned_key_needs_to_be_told(
    wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "root").mkdir()
    host = Host(tmp_path / "root")
    with (
        pytest.raises(SettingsError, match="no key is trusted: put the public key"),
        signed_copy(wheel, host, unsigned=False),
    ):
        pass
    with signed_copy(wheel, host, unsigned=True) as copy:
        assert copy.read_bytes() == wheel.read_bytes()
    assert "is not checked (--unsigned)" in capsys.readouterr().out


def test_the_command_refuses_a_wheel_of_another_key_and_changes_nothing(
    signer: Signer, wheel: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Signer(tmp_path / "other").sign(wheel)
    root = tmp_path / "root"
    pinned(root, signer.text)
    assert main(["update", str(wheel), "--root", str(root)]) == 1
    assert "; trusted is " in capsys.readouterr().err
    assert [path for path in root.rglob("*") if path.is_file()] == [root / PINNED.lstrip("/")]


def test_a_python_without_the_library_says_which_command_checks(
    signer: Signer, wheel: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `python3 -m app.cli` from a wheel's file, which is of the new release itself."""
    load = builtins.__import__

    def without(name: str, *more: Any, **named: Any) -> ModuleType:
        if name.split(".")[0] == "cryptography":
            raise ImportError(name)
        return load(name, *more, **named)

    signer.sign(wheel)
    host = pinned(tmp_path / "root", signer.text)
    monkeypatch.setattr(builtins, "__import__", without)
    with (
        pytest.raises(SettingsError, match="run /opt/operator-panel/current/bin/operator-panel update"),
        signed_copy(wheel, host, unsigned=False),
    ):
        pass


def test_a_release_is_signed_as_an_update_checks_it(signer: Signer, wheel: Path) -> None:
    release.write_sums(wheel.parent)
    release.sign((wheel, wheel.parent / "SHA256SUMS"), str(signer.secret))
    assert release.digest(wheel) in check(wheel, signer)
    assert check_signed(wheel.parent / "SHA256SUMS", parse_keys(signer.text, "keys"))
    release.empty(wheel.parent)
    assert list(wheel.parent.iterdir()) == []


def test_a_release_with_a_key_that_can_not_sign_is_none(wheel: Path) -> None:
    with pytest.raises(release.ReleaseError, match="is not signed"):
        release.sign((wheel,), str(wheel.parent / "none.key"))
