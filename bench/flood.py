"""`python -m bench.flood`: what a flood of alarms costs the server, and whether presses wait for it.

A panel with 10,000 alarms. In turn: a topic at 10 Hz whose value changes none of 1,000 limits;
300 diagnostics at 10 Hz, of which a tenth changes each second; 1,000 alarms that are raised by one
message, and stand; diagnostics and 1,000 returns at once. Presses go on all the time. Prints JSON; with
`QUICK=1` in some seconds. `python -m bench flood` writes it with the other results.
"""

import json
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from bench.parts import cpu_s, rss_mib
from bench.report.figures import percentile
from tests.faults.test_faults_of_alarms import RAISED, panel, press_for, robot, standing
from tests.support.holds import PATIENT
from tests.support.parts import Server, live, until
from tests.support.servers import panel_file, ready

FOR_S: Final = 3.0 if os.environ.get("QUICK") else 30.0
WARM_S: Final = 1.0


def main() -> None:
    print(json.dumps(dict(steps()), indent=2))


def steps() -> Iterator[tuple[str, dict[str, Any]]]:
    """Each step by its name, with what was measured in it."""
    with robot() as flooding, tempfile.TemporaryDirectory(prefix="bench-flood-") as folder:
        path = str(panel_file(Path(folder), panel()))
        with ready(live(flooding.endpoint, Path(folder), KIOSK_PANEL=path, app=PATIENT)) as server:
            until(lambda: standing(server) == 0, "nothing is raised", within_s=60)
            press_for(server, WARM_S)
            yield "a value that changes no limit", measured(server)
            flooding.told("diagnostics")
            yield "300 diagnostics", measured(server)
            flooding.told("diagnostics")
            flooding.told("low")
            yield "1,000 raises", measured(server)
            until(lambda: standing(server) >= RAISED, "all are raised", within_s=60, every_s=0.2)
            yield "1,000 that stand", measured(server)
            flooding.told("diagnostics")
            flooding.told("high")
            yield "300 diagnostics, 1,000 returns", measured(server)


def measured(server: Server) -> dict[str, Any]:
    """The presses of `FOR_S`, with their times in ms, and what the server took in this time."""
    pid = server.process.pid
    began, used = time.monotonic(), cpu_s([pid])
    took = [1000 * seconds for seconds in press_for(server, FOR_S)]
    percent = 100 * (cpu_s([pid]) - used) / (time.monotonic() - began)
    return {
        "presses": len(took),
        "p50": round(percentile(took, 50), 1),
        "longest": round(max(took)),
        "cpu_percent": round(percent, 1),
        "rss_mib": round(rss_mib([pid])),
    }


if __name__ == "__main__":
    main()
