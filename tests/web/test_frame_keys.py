"""Keys of the frame on a page that has none of their kind."""

import re
from pathlib import Path
from typing import Final

from tests.support.servers import demo_server

PANEL: Final = """
title = "Cell"
mode = "demo"
[[interlock]]
id = "operation"
topic = "/operation_enabled"
[[frame.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "jog" }
release = { data = "stopped" }
interlock = "operation"
[[page]]
id = "one"
title = "One"
"""


def test_the_script_of_a_frames_hold_is_loaded_on_every_page(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL) as server:
        html = server.http.get("/pages/one").text
        assert re.findall(r'"kinds":({[^}]*})', html) == ['{"hold":"holds"}']
