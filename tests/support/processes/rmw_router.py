"""A Zenoh router for the tests: `python -m tests.support.processes.rmw_router ENDPOINT`, until SIGTERM.
It is the same router as `zenohd`, in a session of eclipse-zenoh."""

import signal
import sys

import zenoh


def main(endpoint: str) -> None:
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
    with zenoh.open(config):
        print("router: running", file=sys.stderr, flush=True)
        signal.sigwait({signal.SIGTERM, signal.SIGINT})


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    main(sys.argv[1])
