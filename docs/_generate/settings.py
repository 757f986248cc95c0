"""The table of `KIOSK_…` variables in docs/reference/settings.md, made from app/system/settings.py."""

from typing import Final

from app.system.settings import LOG_LEVELS, PREFIX, VARIABLES

ABOUT: Final = {
    "PANEL": ("The panel file.", "`app/panel.toml`, the shipped one"),
    "ZENOH": ("The Zenoh configuration file, in Zenoh's own syntax.", "`zenoh.json5`, the shipped one"),
    "MODE": ("`demo` or `live`. Overrides `mode` of the panel file.", "as the panel file says"),
    "DATA": (
        "The folder for the operator's log, alarms, recipes, trends and recordings.",
        "`$XDG_STATE_HOME/operator-panel`, else `~/.local/state/operator-panel`; "
        "in demo mode its subfolder `demo`, for the example `mobile-robot` `demo-mobile-robot`",
    ),
    "HOSTS": (
        "More host names under which browsers may open the panel, with commas between them, without "
        "ports. Write an IPv6 address in brackets.",
        "only `127.0.0.1`, `localhost` and `[::1]`",
    ),
    "PROXIES": (
        "Proxies whose `X-Forwarded-For` and `X-Forwarded-Proto` headers count: addresses or networks, "
        "with commas between them.",
        "none",
    ),
    "ROOT_PATH": (
        "The path below which a proxy shows the panel, such as `/cell1`. The proxy may remove it or "
        "leave it.",
        "none, or that of uvicorn's `--root-path`",
    ),
    "LOG_LEVEL": (", ".join(f"`{level}`" for level in LOG_LEVELS) + ".", "`info`"),
    "LOG_COPY": (
        "A file, best on another disk, that gets a copy of each entry of the operator's log.",
        "none",
    ),
    "SYSLOG": (
        "A syslog server (RFC 5424 over TLS) that gets each entry of the operator's log: host, or host "
        "and port such as `log.plant:6514`.",
        "none",
    ),
    "SYSLOG_CA": (
        "The certificate authority of that server, as a PEM file.",
        "the system's authorities",
    ),
    "FORWARD": (
        "A TOML file that says to which [central database](../how-to/plant.md) the panel sends what it "
        "keeps.",
        "none: nothing is sent",
    ),
    "WITHOUT": (
        "`tls`, `users` or `tls,users`: listen beyond this machine without them, as behind a proxy of "
        "your own.",
        "none",
    ),
    "TAKE_PANEL": (
        "`1`: an engineer may send another panel file ([Send to a kiosk]"
        "(../how-to/edit-in-the-browser.md#send-to-a-kiosk)).",
        "off",
    ),
    "WALL": (
        "The sites of a [wall](../how-to/wall.md), with commas between, or `*` for all. The server "
        "is then one of a wall, and reads no panel file; `operator-panel wall` sets it.",
        "none: a panel",
    ),
    "DEV": (
        "`1` for development: a page shows a fault of the panel file, pages reload on each save, and "
        "in a checkout `/gallery` shows each widget in each state.",
        "off",
    ),
}


def settings_table() -> str:
    rows = [(f"`{PREFIX}{name}`", *ABOUT[name]) for name in VARIABLES]
    lines = [("Variable", "What it sets", "Default"), ("---",) * 3, *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
