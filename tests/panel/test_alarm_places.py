"""Where a page shows what an alarm is about."""

from pathlib import Path

import pytest

from app.panel import load_panel
from app.panel.alarm_places import alarm_place

WIDGET = """
[[page.widget]]
id = "{0}"
kind = "readout"
label = "{0}"
topic = "{1}"
type = "sensor_msgs/msg/BatteryState"
field = "{2}"
"""
START = """
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
"""
PANEL = (
    'title = "Cell"\n[[page]]\nid = "main"\ntitle = "Main"\n'
    + START
    + WIDGET.format("charge", "/battery", "charge")
    + '[[page]]\nid = "second"\ntitle = "Second"\n'
    + WIDGET.format("voltage", "/battery", "voltage")
)
BATTERY = 'topic = "/battery"\ntype = "sensor_msgs/msg/BatteryState"\n'


@pytest.mark.parametrize(
    ("alarm", "place"),
    [
        (BATTERY + 'field = "voltage"\nlow = 20.0', ("second", "voltage")),
        (BATTERY + 'field = "current"\nlow = 20.0', ("main", "charge")),
        (BATTERY + "stale_s = 2.0", ("main", "charge")),
        (
            'when = { topic = "/battery", type = "sensor_msgs/msg/BatteryState", '
            'field = "voltage", max = 20.0 }',
            ("second", "voltage"),
        ),
        ('node = "/arm"\ninhibits = ["start"]', ("main", "start")),
        ('node = "/arm"', None),
    ],
)
def test_the_widget_that_shows_the_value_else_the_topic_else_what_it_inhibits(
    alarm: str, place: tuple[str, str] | None, tmp_path: Path
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(f'{PANEL}\n[[alarm]]\nid = "low"\ntext = "Low"\n{alarm}\n')
    panel = load_panel(path)
    shown = alarm_place(panel, panel.alarms[0], "")
    assert (shown and (shown.page.id, shown.widget.id)) == place
