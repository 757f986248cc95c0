"""Sets the wall clock of a running process with libfaketime; CLOCK_MONOTONIC is unchanged."""

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
            "FAKETIME_CACHE_DURATION": "1",  # seconds: read at each call, the file takes half a core
            "DONT_FAKE_MONOTONIC": "1",
        }

    def set(self, off_s: int) -> None:
        """Sets the clock to `off_s` seconds from the true time."""
        new = self._file.with_suffix(".new")
        new.write_text(f"{off_s:+d}")
        new.replace(self._file)  # atomic for readers

    def clean(self, pid: int) -> None:
        """Removes the files that the library leaves when its process is killed."""
        for name in (f"faketime_shm_{pid}", f"sem.faketime_sem_{pid}"):
            (Path("/dev/shm") / name).unlink(missing_ok=True)
