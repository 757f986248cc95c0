"""A Zenoh router for the tests: `python -m tests.support.processes.rmw_router ENDPOINT`, until
SIGTERM; or with a configuration file in place of the endpoint. It is the same router as `zenohd`, in a
session of eclipse-zenoh."""

import os
import signal
import sys

import zenoh


def main(place: str) -> None:
    os.environ.pop("ZENOH_RUNTIME", None)  # the panel's own, which its tests have inherited
    config = zenoh.Config.from_file(place) if place.endswith(".json5") else with_defaults(place)
    with zenoh.open(config):
        print("router: running", file=sys.stderr, flush=True)
        signal.sigwait({signal.SIGTERM, signal.SIGINT})


def with_defaults(endpoint: str) -> zenoh.Config:
    config = zenoh.Config()
    for place, value in {
        "mode": '"router"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
        "adminspace/enabled": "true",
        "timestamping/enabled": "true",
        "routing/router/peers_failover_brokering": "false",  # as rmw_zenoh's own configuration has it
    }.items():
        config.insert_json5(place, value)
    return config


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    main(sys.argv[1])
