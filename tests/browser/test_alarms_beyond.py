"""The page of alarms above the rows that the stream brings: it lists and counts of all alarms."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.cell.alarms.shown import MAX_ROWS
from tests.browser.test_alarm_line import started
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

pytestmark = pytest.mark.long("detail")

ALL: Final = MAX_ROWS + 40
LEAST: Final = "air_many"  # of the lowest priority: the stream does not bring it
MANY: Final = "".join(
    f"""
[[alarm]]
id = "many_{number:03}"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Alarm {number}"
group = "Many"
low = 5.0
priority = 3
"""
    for number in range(ALL - 3)
)
LAST: Final = f"""
[[alarm]]
id = "{LEAST}"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Of the lowest priority"
group = "Last"
low = 5.0
priority = 4
"""


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("many")
    with demo_server(folder, PANEL % LOW + MANY + LAST) as server:
        until(lambda: len(listed(server)) == ALL, "all alarms are raised")
        yield server


def rows(page: Page) -> list[str | None]:
    return [item.get_attribute("data-alarm") for item in page.locator("li.alarm").all()]


def test_programs_choose_of_all(kiosk: Server) -> None:
    whole = kiosk.http.get("/alarms").json()
    assert len(whole["alarms"]) == ALL
    assert (whole["more"], whole["more_text"], whole["alarm"]) == (0, "", None)
    first = kiosk.http.get("/alarms", params={"limit": 500, "group": "Many", "alarm": LEAST}).json()
    assert (len(first["alarms"]), first["more"]) == (500, ALL - 503)
    assert (first["counts"]["all"], first["counts"]["shelved"]) == (ALL - 3, 0)
    assert first["alarm"]["id"] == LEAST
    newest = kiosk.http.get("/alarms", params={"priority": 4, "limit": 1, "sort": "newest"}).json()
    assert [row["id"] for row in newest["alarms"]] == [LEAST]
    assert kiosk.http.get("/alarms", params={"show": "shelved"}).json()["alarms"] == []


def test_a_filter_lists_what_the_stream_does_not_bring(kiosk: Server, page: Page) -> None:
    started(page, f"{kiosk.url}/alarms?priority=4")
    row = page.locator(f"li[data-alarm={LEAST}]")
    expect(row).to_have_attribute("data-state", "active")
    act(kiosk, LEAST, "shelve", reason="Tests", for_s=600)
    expect(row).to_have_attribute("data-state", "shelved")
    assert rows(page) == [LEAST]
    expect(page.locator("[data-count=shelved]")).to_have_text("1")
    row.locator(".more-acts").click()
    page.locator("#alarm-sheet").get_by_role("button", name="End shelving").click()
    expect(row).to_have_attribute("data-state", "active")
    expect(page.locator("[data-count=shelved]")).to_have_text("0")


def test_what_is_not_listed_is_counted_with_a_filter_and_without(kiosk: Server, page: Page) -> None:
    started(page, f"{kiosk.url}/alarms")
    expect(page.locator("li.alarm")).to_have_count(MAX_ROWS)
    expect(page.locator(".alarm-list .rest")).to_contain_text(str(ALL - MAX_ROWS))
    expect(page.locator("[data-count=all]")).to_have_text(str(ALL))
    started(page, f"{kiosk.url}/alarms?group=Many")
    act(kiosk, "many_000", "acknowledge", occurrence=1)
    expect(page.locator("[data-count=unacknowledged]")).to_have_text(str(ALL - 4))
    expect(page.locator("li.alarm")).to_have_count(MAX_ROWS)
    expect(page.locator(".alarm-list .rest")).to_contain_text(str(ALL - 3 - MAX_ROWS))


def test_details_of_an_alarm_that_the_stream_does_not_bring_are_not_over(
    kiosk: Server, page: Page
) -> None:
    started(page, f"{kiosk.url}/alarms?alarm={LEAST}")
    acknowledge = page.locator("[data-act=acknowledge] button")
    expect(acknowledge).to_be_enabled()
    act(kiosk, LEAST, "acknowledge", occurrence=listed(kiosk)[LEAST]["occurrence"])
    expect(acknowledge).to_be_disabled()
    expect(page.locator(".details .over")).to_be_hidden()
