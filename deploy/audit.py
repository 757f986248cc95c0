"""`python deploy/audit.py [LOCK …]`: known weaknesses of the locked dependencies, by pip-audit.

Exit status: 0 none is known, 1 some are, 2 not all could be checked, such as without a network: that is
no result.
"""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ("deploy/requirements.lock", "tests/requirements.lock", "docs/requirements.lock")
COMMAND = ("-m", "pip_audit", "--disable-pip", "--require-hashes", "--progress-spinner=off")


class Weakness(NamedTuple):
    """A known weakness of a locked package, and the versions in which it is fixed."""

    package: str
    version: str
    id: str
    fixed: tuple[str, ...]

    def __str__(self) -> str:
        fixed = ", ".join(self.fixed) or "no version"
        return f"{self.package} {self.version}: {self.id}, fixed in {fixed}"


def audit(lock: Path) -> tuple[list[Weakness], list[str]]:
    """The known weaknesses of a lock file, and what could not be checked."""
    command = [sys.executable, *COMMAND, "--format=json", "--requirement", str(lock)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        report: Mapping[str, Any] = json.loads(done.stdout)
    except ValueError:
        last = (done.stderr.strip().splitlines() or ["pip-audit printed nothing"])[-1]
        return [], [f"{lock.name}: {last}"]
    weak = [
        Weakness(each["name"], each["version"], weakness["id"], tuple(weakness["fix_versions"]))
        for each in report["dependencies"]
        for weakness in each.get("vulns", ())
    ]
    unchecked = [
        f"{each['name']}: {each['skip_reason']}"
        for each in report["dependencies"]
        if "skip_reason" in each
    ]
    return weak, unchecked


def main(locks: Sequence[str]) -> int:
    weak: dict[Weakness, None] = {}
    unchecked: dict[str, None] = {}
    for lock in locks or [str(ROOT / name) for name in LOCKS]:
        some, others = audit(Path(lock))
        weak |= dict.fromkeys(some)
        unchecked |= dict.fromkeys(others)
    for line in weak:
        print(line)
    if unchecked:
        first = next(iter(unchecked))
        print(f"{len(unchecked)} could not be checked, the first: {first}", file=sys.stderr)
    if weak:
        return 1
    if unchecked:
        print("the data of known weaknesses was not reached: this is no result", file=sys.stderr)
        return 2
    print("no known weakness")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
