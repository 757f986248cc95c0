"""`python -m docs._generate`: writes what the documentation takes from the code into its pages, between
`<!-- name -->` and `<!-- /name -->`, and the JSON Schema of the panel file.

With `--check` nothing is written; exit status 1 names the files that are out of date.
"""

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from app.panel.reference.schema import panel_schema
from bench.report.pages import comparison_table, last_results, readme_section
from docs._generate.findings import findings_tables
from docs._generate.icon_names import icon_list
from docs._generate.keys import key_tables
from docs._generate.limits import limits_table
from docs._generate.locks import lock_tables, translated_page, translations
from docs._generate.places import models_table, paths_table, sentences_table
from docs._generate.settings import settings_table

DOCS: Final = Path(__file__).parent.parent
SCHEMA: Final = DOCS / "panel.schema.json"


def files() -> Iterator[tuple[Path, str]]:
    """Each file that has something of the code in it, and what should stand there."""
    yield SCHEMA, json.dumps(panel_schema(), indent=1, ensure_ascii=False) + "\n"
    pages: Mapping[str, Mapping[str, str]] = {
        "reference/panel-file.md": key_tables(),
        "reference/icons.md": {"icons": icon_list()},
        "reference/locks.md": lock_tables(),
        "reference/settings.md": {"settings": settings_table()},
        "reference/http.md": {"limits": limits_table()},
        "reference/sentences.md": {"sentences": sentences_table()},
        "how-to/doctor.md": findings_tables(),
        "comparison.md": {"figures": comparison_table(last_results())},
        "../README.md": {"figures": readme_section(last_results())},
        "architecture.md": {"paths": paths_table(), "models": models_table()},
    }
    for name, parts in pages.items():
        page = DOCS / name
        yield page, filled(page.read_text(encoding="utf-8"), parts, name)
    for language, advice in translations().items():
        yield DOCS / f"reference/locks.{language}.md", translated_page(language, advice)


def filled(text: str, parts: Mapping[str, str], name: str) -> str:
    """The page with its parts; ValueError where it has no place for one."""
    for part, made in parts.items():
        begin, end = f"<!-- {part} -->\n", f"<!-- /{part} -->\n"
        before, marker, rest = text.partition(begin)
        _, ended, after = rest.partition(end)
        if not marker or not ended:
            raise ValueError(f"{name} has no section between {begin.strip()} and {end.strip()}")
        text = f"{before}{begin}{made}\n{end}{after}"
    return text


def out_of_date() -> list[str]:
    """The files that are not as the code is."""
    return [
        path.name
        for path, text in files()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def main(arguments: list[str]) -> int:
    if arguments == ["--check"]:
        if old := out_of_date():
            print(f"out of date: {', '.join(old)}; run `make docs`", file=sys.stderr)
        return 1 if old else 0
    for path, text in files():
        path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
