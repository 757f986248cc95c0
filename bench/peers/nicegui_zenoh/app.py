"""A NiceGUI page on a Zenoh subscriber: `app.py PORT LOCATOR [TOPIC…]`."""

import asyncio
import json
import sys

import zenoh
from nicegui import app, binding, ui

port, locator, *topics = sys.argv[1:]


@binding.bindable_dataclass
class Robot:
    enabled: bool = False


@binding.bindable_dataclass
class Heard:
    text: str = ""


robot = Robot()
heard = {topic.removeprefix("/"): Heard() for topic in topics}


def text_of(cdr: bytes) -> str:
    length = int.from_bytes(cdr[4:8], "little")  # with the NUL at its end
    return cdr[8 : 7 + length].decode()


def show(key: str, cdr: bytes) -> None:
    if key == "operation_enabled":
        robot.enabled = bool(cdr[4])
    else:
        heard[key].text = text_of(cdr)


def publish(text: str) -> None:
    data = text.encode() + b"\0"
    app.state.publisher.put(b"\x00\x01\x00\x00" + len(data).to_bytes(4, "little") + data)


async def connect() -> None:
    loop = asyncio.get_running_loop()

    def came(sample: zenoh.Sample) -> None:
        loop.call_soon_threadsafe(show, str(sample.key_expr), sample.payload.to_bytes())

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([locator]))
    config.insert_json5("transport/shared_memory/enabled", "false")  # it would leave files behind
    app.state.session = zenoh.open(config)
    for key in ("operation_enabled", *heard):
        app.state.session.declare_subscriber(key, came)
    app.state.publisher = app.state.session.declare_publisher("operation1")


app.on_startup(connect)
app.on_shutdown(lambda: app.state.session.close())


def page() -> None:
    text = ui.input(value="hello").props("for=text")
    button = ui.button("Publish", on_click=lambda: publish(text.value)).classes("publish")
    button.bind_enabled_from(robot, "enabled")
    for key, shown in heard.items():
        ui.label().props(f'data-topic="/{key}"').bind_text_from(shown, "text")


ui.page("/")(page)
ui.run(host="127.0.0.1", port=int(port), title="NiceGUI", show=False, reload=False)
