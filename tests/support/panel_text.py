"""Parts of panel files: a cell with an interlock and one page, and widgets for it."""

from typing import Final

OPERATION: Final = """
[[interlock]]
id = "operation"
topic = "/operation_enabled"
"""
MAIN: Final = """
[[page]]
id = "main"
title = "Main"
"""
CELL: Final = f'title = "Cell"\nnamespace = "/cell9"\n{OPERATION}{MAIN}'
START: Final = """
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
LOCKED_START: Final = f'{START}interlock = "operation"\n'
COUNT: Final = """
[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/count"
type = "example_interfaces/action/Fibonacci"
goal = { order = 3 }
"""
SPEED: Final = """
[[page.widget]]
id = "speed"
kind = "parameter"
label = "Speed"
node = "/arm"
parameter = "speed"
type = "double"
"""
ADD: Final = """
[[page.widget]]
id = "add"
kind = "call"
label = "Add"
service = "/add_two_ints"
type = "example_interfaces/srv/AddTwoInts"
request = { a = 40, b = 2 }
answer = "the sum is {sum}"
"""
