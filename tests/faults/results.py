"""The results of the fault suite: lines of JSON in the file `FAULTS_RESULTS`, and a table.

`python -m tests.faults.results RESULTS [PAGE]` prints the table, and writes it between the two markers
of a page.
"""

import json
import os
import sys
from pathlib import Path
from typing import Final

COLUMNS: Final = {
    "fault": "what breaks",
    "locked": "locked after",
    "presses": "presses during it",
    "latest": "latest arrival",
    "after": "afterwards",
}
BEGIN: Final = "<!-- faults -->"
END: Final = "<!-- /faults -->"


def record(
    fault: str, *, locked: str = "", presses: object = "", latest: str = "", after: str = ""
) -> None:
    """Appends a row to the results file, if one is set."""
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


def main(results: str, page: str = "") -> None:
    rows = [json.loads(line) for line in Path(results).read_text().splitlines()]
    text = table(rows)
    print(text)
    if page:
        write(text, Path(page))


def write(text: str, page: Path) -> None:
    """Writes the table between the page's two markers; ValueError if it has none."""
    before, begin, rest = page.read_text().partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page} has no section between {BEGIN} and {END}")
    page.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}")


if __name__ == "__main__":
    main(*sys.argv[1:])
