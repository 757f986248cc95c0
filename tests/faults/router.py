"""`python router.py LISTEN CONNECT`: a Zenoh router; ends when its stdin is closed."""

import json
import sys

import zenoh


def main(listen: str, connect: str) -> None:
    config = zenoh.Config()
    for place, value in {
        "mode": "router",
        "listen/endpoints": [listen],
        "connect/endpoints": [connect],
        "scouting/multicast/enabled": False,
        "transport/link/tx/lease": 2000,
    }.items():
        config.insert_json5(place, json.dumps(value))
    with zenoh.open(config):
        print("ready", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(*sys.argv[1:])
