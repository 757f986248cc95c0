"""A wall clock that is set under a running process: libfaketime, which leaves CLOCK_MONOTONIC be."""

from pathlib import Path

LIBRARY = "libfaketimeMT.so.1"


def library() -> Path:
    places = [
        path for folder in ("/usr/lib", "/usr/local/lib") for path in Path(folder).glob(f"**/{LIBRARY}")
    ]
    assert places, f"{LIBRARY} is missing: `make test` installs it (Debian's package faketime)"
    return places[0]


class Clock:
    """The wall clock of the processes that were started with its `environment`."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "clock"
        self.set(0)
        self.environment = {
            "LD_PRELOAD": str(library()),
            "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_NO_CACHE": "1",
            "DONT_FAKE_MONOTONIC": "1",
        }

    def set(self, off_s: int) -> None:
        """So many seconds from the true time."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{off_s:+d}")
        new.replace(self._file)  # a reader never finds half of it

    def clean(self, pid: int) -> None:
        """What the library leaves of a process that a signal ended."""
        for name in (f"faketime_shm_{pid}", f"sem.faketime_sem_{pid}"):
            (Path("/dev/shm") / name).unlink(missing_ok=True)
