"""What a browser requests until the first button of a page works: how many files, and how many bytes
with their heads. Nothing of it is in its cache."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import pytest

from tests.budgets import check
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import demo_server, ready

THREE: Final = """
title = "Robot cell 1"
[[page]]
id = "cell"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "speed"
kind = "readout"
label = "Speed"
topic = "/speed"
type = "std_msgs/msg/Float64"
field = "data"
[[page.widget]]
id = "ready"
kind = "indicator"
label = "Ready"
topic = "/ready"
type = "std_msgs/msg/Bool"
field = "data"
states = [
  { value = true, text = "Ready", shape = "circle" },
  { value = false, text = "Not ready", shape = "cross", colour = "white" },
]
"""
# What the browser requests by the markup, without its cookie: it has no fonts yet.
FILES: Final = re.compile(
    r'<link rel="(?:stylesheet|modulepreload|preload)" href="([^"]+)"'
    r'|<img [^>]*src="([^"]+)"|data-src="([^"]+)"'
)


class FirstPage(NamedTuple):
    requests: int
    size: int  # in bytes


def first_page(server: Server) -> FirstPage:
    """The page and its files, compressed, each with its head."""
    files = [
        *dict.fromkeys("".join(parts) for parts in FILES.findall(server.http.get("/pages/cell").text))
    ]
    size = 0
    for path in ("/pages/cell", *files):
        with server.http.stream("GET", path) as answer:
            answer.read()
            assert answer.status_code == 200, path
            size += answer.num_bytes_downloaded
            size += sum(len(name) + len(value) + 4 for name, value in answer.headers.raw)
    return FirstPage(1 + len(files), size)


def check_page(page: FirstPage, name: str) -> None:
    check(f"first page, {name}: requests", page.requests)
    check(f"first page, {name}: bytes", page.size)


@pytest.fixture(scope="module")
def shipped() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED), KIOSK_MODE="demo")) as mine:
        yield mine


def test_first_page_of_the_shipped_panel_has_its_size(shipped: Server) -> None:
    check_page(first_page(shipped), "shipped panel")


def test_first_page_of_three_widgets_has_its_size(tmp_path: Path) -> None:
    with demo_server(tmp_path, THREE) as server:
        check_page(first_page(server), "three widgets")
