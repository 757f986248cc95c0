"""A Zenoh router in a session of eclipse-zenoh, for the tests of `make test`:
`python -m tests.support.processes.session_router ENDPOINT`, until SIGTERM; or with a configuration file
in place of the endpoint. All other tests use `zenohd`."""

import json
import os
import signal
import sys

import zenoh

from tests.support.rmw import LISTENS


def main(place: str) -> None:
    os.environ.pop("ZENOH_RUNTIME", None)  # the panel's own, which its tests have inherited
    config = zenoh.Config.from_file(place) if place.endswith(".json5") else with_defaults(place)
    with zenoh.open(config):
        for endpoint in json.loads(config.get_json("listen/endpoints")):
            print(LISTENS, endpoint, file=sys.stderr, flush=True)
        signal.sigwait({signal.SIGTERM, signal.SIGINT})


def with_defaults(endpoint: str) -> zenoh.Config:
    config = zenoh.Config()
    for place, value in {
        "mode": '"router"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
        "adminspace/enabled": "true",
        "timestamping/enabled": "true",
    }.items():
        config.insert_json5(place, value)
    return config


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    main(sys.argv[1])
