"""A panel with presses and alarms that a person confirms, and its users."""

from pathlib import Path
from typing import Final

from tests.support.users import add_user

PANEL: Final = """
title = "Cell 7"
mode = "demo"
distro = "jazzy"
mm_per_px = 0.22
language = "en"
languages = ["en", "ja", "de"]

[frame]
[[frame.widget]]
id = "halt"
kind = "publish"
label = "Stop"
role = "stop"
topic = "/halt"
type = "std_msgs/msg/Bool"
message = { data = true }

[[interlock]]
id = "operation"
topic = "/operation_enabled"
type = "std_msgs/msg/Bool"
field = "data"

[[page]]
id = "main"
title = { en = "Operation", ja = "操作", de = "Bedienen" }

[[page.group]]
title = { en = "Oven", ja = "炉", de = "Ofen" }

[[page.group.widget]]
id = "heat"
kind = "number"
label = { en = "Temperature", ja = "温度", de = "Temperatur" }
unit = "°C"
min = 20
max = 900
default = 200
span = 6

[[page.group.widget]]
id = "start"
kind = "publish"
label = { en = "Heat up", ja = "加熱", de = "Aufheizen" }
topic = "/heat"
type = "std_msgs/msg/Float64"
message = { data = "{heat}" }
interlock = "operation"
confirm_press = "pin"
consequence = { en = "The oven heats up.", ja = "炉が加熱されます。", de = "Der Ofen heizt auf." }
span = 6

[[page.group.widget]]
id = "bypass"
kind = "call"
label = { en = "Bypass the door", ja = "ドア無効化", de = "Tür überbrücken" }
service = "/bypass"
type = "std_srvs/srv/Trigger"
interlock = "operation"
confirm_press = "two_persons"
needs = "maintenance"
span = 4

[[page.group.widget]]
id = "light"
kind = "switch"
label = { en = "Service light", ja = "作業灯", de = "Wartungslicht" }
topic = "/light"
type = "std_msgs/msg/Bool"
on_message = { data = true }
off_message = { data = false }
reported = { topic = "/light_is_on", type = "std_msgs/msg/Bool" }
confirm_press = "pin"
span = 4

[[page.group.widget]]
id = "jog"
kind = "hold"
label = { en = "Jog +", ja = "ジョグ +", de = "Tippen +" }
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = 0.1 }
release = { data = 0.0 }
interlock = "operation"
confirm_press = "pin"
span = 4

[demo."/operation_enabled"]
values = [true]
"""
ALARMS: Final = """
[[alarm]]
id = "hot"
text = { en = "Oven hot", ja = "炉が高温", de = "Ofen heiß" }
confirm_act = "pin"
topic = "/oven"
type = "std_msgs/msg/Float64"
high = 50

[[alarm]]
id = "guard"
text = { en = "Guard open", ja = "ガード開", de = "Schutz offen" }
confirm_act = "two_persons"
topic = "/oven"
type = "std_msgs/msg/Float64"
high = 40

[[alarm]]
id = "plain"
text = { en = "Warm", ja = "高温", de = "Warm" }
topic = "/oven"
type = "std_msgs/msg/Float64"
high = 30

[demo."/oven"]
values = [80]
"""
PINS: Final = {"M. Sato": "2580", "K. Novak": "1470", "J. Brandt": "3691"}


def add_users(data: Path) -> None:
    """An operator with PIN and badge, two who maintain, and one who signs in with a password."""
    add_user(data, "M. Sato", "operator", pin="2580", badge="04A2B3C4")
    add_user(data, "K. Novak", "maintenance", pin="1470")
    add_user(data, "J. Brandt", "engineer", pin="3691", badge="77AA88BB")
    add_user(data, "L. Rossi", "maintenance", password="long enough")
