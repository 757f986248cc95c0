"""A newer release in a folder."""

from pathlib import Path

import pytest

from app.system.releases import NewRelease, newest_release, version_key
from tests.support.signed import Signer
from tests.tools.install.test_plan import make_wheel


def test_versions_are_ordered_by_their_numbers() -> None:
    ordered = [
        "0.9.1",
        "0.10.0.dev1",
        "0.10.0a1",
        "0.10.0rc1",
        "0.10.0rc2",
        "0.10.0",
        "0.10.0.post1",
        "0.10.1",
    ]
    assert sorted(reversed(ordered), key=version_key) == ordered
    assert version_key("1.0") == version_key("1.0.0") == version_key("1.0.0+local")
    assert version_key("(a checkout, not installed)") < version_key("0.0.1")


class TestFolder:
    @pytest.fixture
    def signer(self, tmp_path: Path) -> Signer:
        return Signer(tmp_path / "keys")

    def newest(self, folder: Path, signer: Signer, version: str = "0.1.0") -> NewRelease | None:
        return newest_release(folder / "updates", version, signer.public)

    def test_the_newest_signed_wheel_is_found(self, tmp_path: Path, signer: Signer) -> None:
        assert self.newest(tmp_path, signer) is None
        for version in ("0.1.0", "0.2.0", "0.10.0"):
            signer.sign(make_wheel(tmp_path / "updates", version), comment=f"{version} for cell 1")
        release = self.newest(tmp_path, signer)
        assert release is not None
        assert (release.version, release.fault) == ("0.10.0", "")
        assert release.signed.endswith(": 0.10.0 for cell 1")
        assert self.newest(tmp_path, signer, "0.10.0") is None

    def test_a_wheel_without_a_signature_that_fits_gives_way_to_an_older_one(
        self, tmp_path: Path, signer: Signer
    ) -> None:
        make_wheel(tmp_path / "updates", "0.3.0")
        release = self.newest(tmp_path, signer)
        assert release is not None
        assert "is not signed" in release.fault
        signer.sign(make_wheel(tmp_path / "updates", "0.2.0"))
        release = self.newest(tmp_path, signer)
        assert release is not None
        assert (release.version, release.fault) == ("0.2.0", "")
        missing = newest_release(tmp_path / "updates", "0.1.0", tmp_path / "none")
        assert missing is not None
        assert "No such file" in missing.fault
