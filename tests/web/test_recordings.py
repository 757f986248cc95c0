"""The download of the last minute as an MCAP file."""

import re
import time
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

from tests.support.parts import Server, until
from tests.support.servers import demo_server

PANEL: Final = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "boxes"
kind = "readout"
label = "Boxes"
topic = "/boxes"
type = "std_msgs/msg/UInt32"
"""
RECORD: Final = "[record]\nbefore_s = 1\n"
PATH: Final = "/recordings/last.mcap"
MINUTE_NS: Final = 60_000_000_000


def topics(server: Server) -> dict[str, list[tuple[int, bytes]]]:
    """The messages of the file, with their log times, by topic."""
    answer = server.http.get(PATH)
    assert answer.status_code == 200
    messages: dict[str, list[tuple[int, bytes]]] = {}
    for _, channel, message in make_reader(BytesIO(answer.content)).iter_messages():
        messages.setdefault(channel.topic, []).append((message.log_time, message.data))
    return messages


def test_the_last_minute_is_a_file_that_others_read(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL + RECORD) as server:
        until(lambda: len(topics(server).get("/boxes", ())) > 2, "some values have arrived")
        messages = topics(server)["/boxes"]
        times = [at for at, _ in messages]
        assert times == sorted(times)
        assert 0 <= time.time_ns() - times[0] <= 2 * MINUTE_NS
        types = get_typestore(Stores.ROS2_JAZZY)
        read: Any = types.deserialize_cdr(messages[-1][1], "std_msgs/msg/UInt32")
        assert str(read.data).isdigit()
        headers = server.http.get(PATH).headers
        name = r'attachment; filename="\d{8}T\d{6}Z-last-minute\.mcap"'
        assert re.fullmatch(name, headers["content-disposition"])
        assert headers["cache-control"] == "no-store"
        page = server.http.get("/diagnostics", headers={"accept": "text/html"}).text
        assert f'action="{PATH}"' in page


def test_a_panel_that_records_nothing_has_no_last_minute(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL) as server:
        assert server.http.get(PATH).status_code == 404
        page = server.http.get("/diagnostics", headers={"accept": "text/html"}).text
        assert PATH not in page
