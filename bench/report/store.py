"""The results of a run, saved as JSON after each measurement."""

import json
import math
import os
import platform
import subprocess
import sys
import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from bench.report.figures import median
from tests.support.parts import ROOT

Results = dict[str, Any]


class Store:
    """`results` is {"machine": …, "faults": {…}, "<phase>": {"at": …, "commit": …, "rounds":
    [{"<peer>": {"<figure>": number}}]}}; phases that were not measured again stay as they were."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.results: Results = json.loads(path.read_text()) if path.exists() else {}
        self.results["faults"] = {}

    def machine(self, chromium: str, sizes: Mapping[str, Any]) -> None:
        self.results["machine"] = {
            "processor": _processor(),
            "cores": os.cpu_count(),
            "system": f"{platform.system()} {platform.release()}",
            "python": platform.python_version(),
            "chromium": chromium,
            "load_before": round(os.getloadavg()[0], 2),
        }
        self.results["sizes"] = dict(sizes)

    def begin(self, phase: str) -> None:
        self.results[phase] = {"at": time.strftime("%Y-%m-%d %H:%M"), "commit": _commit(), "rounds": []}
        self._save()

    def add(self, phase: str, turn: int, name: str, figures: Mapping[str, Any]) -> None:
        rounds = self.results[phase]["rounds"]
        while len(rounds) <= turn:
            rounds.append({})
        rounds[turn][name] = {key: _rounded(figure) for key, figure in figures.items()}
        self._save()

    def fault(self, where: str, error: str) -> None:
        print(f"{where}: {error}", file=sys.stderr, flush=True)
        self.results["faults"][where] = error.strip().splitlines()[0][:300]
        self._save()

    @contextmanager
    def faults(self, where: str) -> Iterator[None]:
        """Stores an error of one measurement; the next ones continue."""
        try:
            yield
        except Exception as error:
            traceback.print_exc()
            self.fault(where, f"{type(error).__name__}: {error}")

    def _save(self) -> None:
        new = self._path.with_suffix(".new")
        new.write_text(json.dumps(self.results, indent=1, ensure_ascii=False) + "\n")
        new.replace(self._path)


def figure(results: Results, phase: str, peer: str, name: str) -> float:
    """The median over the rounds; NaN if it was not measured."""
    rounds = results.get(phase, {}).get("rounds", [])
    values = [figures[peer][name] for figures in rounds if name in figures.get(peer, {})]
    return median([value for value in values if value is not None])


def _rounded(value: Any) -> Any:
    """Rounded to four digits; None for NaN and infinity, which JSON does not have."""
    if isinstance(value, float):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return value


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return result.stdout.strip()
