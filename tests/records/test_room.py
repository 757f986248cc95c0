"""Whether the log has room for its days, with logs that were filled fast for a test."""

import time
from pathlib import Path
from typing import Final

import pytest

from app.records.entry import new_entry
from app.records.room import LogRoom, log_room
from app.records.store import Store

NOW: Final = 1_800_000_000_000  # ms since 1970
MB: Final = 1_000_000


def fill(folder: Path, begin: float, count: int, until: float | None = None) -> None:
    """Writes a log whose entries are spread over the time from `begin` to `until`, by default now; in
    seconds since the epoch."""
    end = time.time() if until is None else until
    store = Store(folder, "filled")
    step = (end - begin) / count
    about = {"speed": 0.25, "number": 1}
    entry = new_entry("control", None, about, action="control_take")
    store.append([entry._replace(at=int(1000 * (begin + n * step))) for n in range(count)])
    store.close()


def filled(folder: Path, days: float, per_day: int) -> None:
    """A log of the last days, with as many entries a day."""
    folder.mkdir(parents=True, exist_ok=True)
    fill(folder, NOW / 1000 - days * 86_400, int(days * per_day), NOW / 1000)


def measured(folder: Path, days: float = 365.0, size_mb: float = 512.0, free: int = 10**12) -> LogRoom:
    room = log_room(folder, days, size_mb, lambda _: free, NOW)
    assert room is not None
    return room


def test_the_rate_and_the_size_of_an_entry_are_measured(tmp_path: Path) -> None:
    filled(tmp_path, 10, 2000)
    room = measured(tmp_path)
    assert room.measured_days == 7
    assert room.entries_per_day == pytest.approx(2000, rel=0.01)
    size = sum(file.stat().st_size for file in tmp_path.glob("operators-log.sqlite3*"))
    assert 100 < room.entry_bytes <= size / 20_000
    assert room.needed_mb == pytest.approx(2000 * 365 * room.entry_bytes / MB, rel=0.01)


def test_five_years_are_short_where_a_year_is_not(tmp_path: Path) -> None:
    filled(tmp_path, 8, 2000)
    year = measured(tmp_path)
    assert not year.is_short
    five_years = measured(tmp_path, days=1830)
    assert five_years.is_short
    assert five_years.days_kept == pytest.approx(year.days_kept)
    assert five_years.share == pytest.approx(1830 / five_years.days_kept)
    assert not measured(tmp_path, days=1830, size_mb=5000).is_short


@pytest.mark.parametrize(("factor", "expected"), [(1.24, True), (1.26, False)])
def test_it_is_short_from_80_percent_of_the_room(tmp_path: Path, factor: float, expected: bool) -> None:
    filled(tmp_path, 8, 500)
    needed = measured(tmp_path).needed_mb
    assert measured(tmp_path, size_mb=needed * factor).is_short is expected


def test_the_disk_may_have_less_room_than_the_panel_file_says(tmp_path: Path) -> None:
    filled(tmp_path, 8, 500)
    room = measured(tmp_path, free=3 * MB)
    assert 3 < room.room_mb < 10
    assert room.is_short


def test_from_less_than_a_day_nothing_is_concluded(tmp_path: Path) -> None:
    assert log_room(tmp_path, 365, 512, lambda _: 10**12, NOW) is None
    filled(tmp_path, 0.9, 1000)
    assert log_room(tmp_path, 365, 512, lambda _: 10**12, NOW) is None


def test_a_rate_that_has_risen_is_that_of_the_last_week(tmp_path: Path) -> None:
    filled(tmp_path, 60, 10)
    fill(tmp_path, NOW / 1000 - 6 * 86_400, 6000, NOW / 1000)
    assert measured(tmp_path).entries_per_day == pytest.approx(6060 / 7, rel=0.05)
