"""What the faults measured, as lines of JSON in the file that `FAULTS_RESULTS` names, and as a table.

`python -m tests.faults.results RESULTS [README]` prints the table; with a README it is written there,
between its two markers.
"""

import json
import os
import sys
from pathlib import Path
from typing import Final

COLUMNS: Final = {
    "fault": "what breaks",
    "locked": "locked after",
    "presses": "presses meanwhile",
    "latest": "latest arrival",
    "after": "afterwards",
}
BEGIN: Final = "<!-- faults -->"
END: Final = "<!-- /faults -->"


def record(
    fault: str, *, locked: str = "", presses: object = "", latest: str = "", after: str = ""
) -> None:
    """Keeps one row, if anybody collects them."""
    if path := os.environ.get("FAULTS_RESULTS"):
        row = {
            "fault": fault,
            "locked": locked,
            "presses": str(presses),
            "latest": latest,
            "after": after,
        }
        with Path(path).open("a") as results:
            results.write(json.dumps(row) + "\n")


def ms(seconds: float) -> str:
    return f"{seconds * 1000:.0f} ms" if seconds < 1 else f"{seconds:.1f} s"


def table(rows: list[dict[str, str]]) -> str:
    lines = [list(COLUMNS.values()), ["---"] * len(COLUMNS)]
    lines += [[row[column] or "–" for column in COLUMNS] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(results: str, readme: str = "") -> None:
    rows = [json.loads(line) for line in Path(results).read_text().splitlines()]
    text = table(rows)
    print(text)
    if readme:
        page = Path(readme).read_text()
        before, _, rest = page.partition(BEGIN)
        _, _, after = rest.partition(END)
        Path(readme).write_text(f"{before}{BEGIN}\n{text}\n{END}{after}")


if __name__ == "__main__":
    main(*sys.argv[1:])
