"""The certificate that the server shows: loaded again when its files change, without a restart. A
connection keeps the one with which it began."""

import asyncio
import logging
import ssl
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from app.system.certificates import Listed

log = logging.getLogger("kiosk.certificate")

CHECK_S: Final = 1.0
PATIENCE: Final = 3  # checks: certificate and key are two files, of which one is replaced first
Version = tuple[tuple[int, int, int], ...]


class ServedCertificate:
    """The files of the server's certificate and key, and its TLS context."""

    def __init__(
        self, file: Path, key: Path | None, password: str | None, context: ssl.SSLContext
    ) -> None:
        """`key` is None if it is in the certificate's file."""
        self.file = file
        self._key = key
        self._password = password
        self._context = context
        self._loaded = self._version()
        self._failed = 0
        self.fault = ""  # why the new files can't be used; the old certificate is served

    async def watch(self) -> None:
        """Loads the files again after each change, until it is cancelled."""
        while True:
            await asyncio.sleep(CHECK_S)
            version = await asyncio.to_thread(self._changed)
            if version is not None:
                self._reload(version)

    def _reload(self, version: Version) -> None:
        """On the event loop, which begins connections with the context."""
        try:
            self._load(ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER))  # half a pair is not kept
            self._load(self._context)
        except (OSError, ValueError) as error:
            self._failed += 1
            if self._failed < PATIENCE:
                return
            from app.system.certificates import pair_fault

            self.fault = pair_fault(self.file, self._key, self._password) or str(error)
            log.error("%s; the old certificate stays", self.fault)
        else:
            self.fault = ""
            log.info("the certificate %s was loaded again%s", self.file, _until(self.file))
        self._failed, self._loaded = 0, version

    def _load(self, context: ssl.SSLContext) -> None:
        context.load_cert_chain(self.file, self._key, self._password)

    def _changed(self) -> Version | None:
        """What the files are now, if they are others than those that were loaded."""
        version = self._version()
        return None if version == self._loaded else version

    def _version(self) -> Version:
        """Of the files, through links; one that is not there has none."""
        known = []
        for file in filter(None, (self.file, self._key)):
            with suppress(OSError):
                stat = file.stat()
                known.append((stat.st_ino, stat.st_mtime_ns, stat.st_size))
        return tuple(known)


def _until(file: Path) -> str:
    listed = readable((file,))
    return f", valid until {listed[0].until.date().isoformat()}" if listed else ""


def readable(files: Sequence[Path]) -> "list[Listed]":
    """The certificates that can be read; the others are logged."""
    from app.system.certificates import CertificateError, about

    listed = []
    for file in files:
        try:
            listed.append(about(file))
        except CertificateError as error:
            log.warning("when a certificate ends is not known: %s", error)
    return listed


class UsedCertificates(NamedTuple):
    """The certificates that a server uses: the files of its link to the robot, and its own."""

    files: Sequence[Path] = ()
    served: ServedCertificate | None = None

    @property
    def all_files(self) -> tuple[Path, ...]:
        return (*([self.served.file] if self.served else ()), *self.files)

    @property
    def fault(self) -> str:
        """Why the server's new one can't be used; "" if it can."""
        return self.served.fault if self.served else ""


NO_FILES: Final = UsedCertificates()
