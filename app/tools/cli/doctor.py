"""`operator-panel doctor [PANEL]`: what is wrong between a panel, this machine and the robot.

Exit status: 0 all is well (notes do not count), 1 there are findings, 2 it could not look.
"""

import asyncio
import json
import os
import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, Final

from app.system.errors import KioskError
from app.system.printable import one_line
from app.system.settings import Settings
from app.system.version import installed_version
from app.tools.cli.arguments import add_settings, environment, port, seconds
from app.tools.cli.parser import Parser
from app.tools.doctor.doctor import Diagnosis, Options, diagnose
from app.tools.doctor.findings import MOST_TEXT, SEVERITIES, Finding, Report
from app.tools.doctor.robot import LISTEN_S

PROG: Final = "python -m app.cli doctor"
WELL, FINDINGS, FAILED = range(3)
LONGEST_LISTEN_S: Final = 600.0


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parsed = make_parser(prog).parse_args(arguments)
    try:
        settings = settings_of(parsed)
        diagnosis = asyncio.run(diagnose(settings, options_of(parsed)))
    except KioskError as error:
        print(error, file=sys.stderr)
        return FAILED
    if parsed.json:
        print(json.dumps(as_json(settings, diagnosis), indent=2, ensure_ascii=False))
    else:
        print(as_text(diagnosis.report, parsed.verbose))
    return WELL if diagnosis.report.is_well else FINDINGS


def check(settings: Settings, host: str, port: int) -> Iterator[dict[str, Any]]:
    """The result for a server that listens there; KioskError if it could not look."""
    yield as_json(settings, asyncio.run(diagnose(settings, Options(host=host, port=port))))


def settings_of(options: Any) -> Settings:
    """The settings of the environment, with what the command line says instead."""
    return Settings.from_environment({**os.environ, **environment(options)})


def options_of(options: Any) -> Options:
    return Options(host=options.host, port=options.port, listen_s=options.listen)


def as_json(settings: Settings, diagnosis: Diagnosis) -> dict[str, Any]:
    """What `--json` prints; see docs/how-to/doctor.md."""
    return {
        "version": installed_version(),
        "panel": str(settings.panel),
        "well": diagnosis.report.is_well,
        "findings": [finding.as_json() for finding in diagnosis.report.findings],
        "more": dict(diagnosis.report.more),
        "facts": diagnosis.report.facts,
    }


def as_text(report: Report, verbose: bool = False) -> str:
    """A line for each finding, errors first; after those of one kind what to do about them."""
    lines = [f"ok       {fact}" for fact in report.facts] if verbose else []
    ordered = [
        finding
        for severity in SEVERITIES
        for finding in report.findings
        if finding.severity == severity
    ]
    last = {finding.code: finding for finding in ordered}
    for advice, findings in groupby(ordered, lambda finding: finding.do):
        for finding in findings:
            lines.append(_line(finding))
            if finding is last[finding.code] and report.more[finding.code]:
                lines.append(f"         … and {report.more[finding.code]} more")
        lines.append(f"         → {advice}")
    counts = [(n, severity) for severity in SEVERITIES if (n := report.count(severity))]
    listed = ", ".join(f"{number} {severity}{'s' * (number > 1)}" for number, severity in counts)
    result = "All is well" if report.is_well else "Something is wrong"
    passed = len(report.facts) + report.more_facts
    lines.append(f"{result}: {listed or 'nothing was found'}, {passed} checks were passed.")
    return "\n".join(lines)


def _line(finding: Finding) -> str:
    robot = f" of robot {finding.robot}" if finding.robot else ""
    about = "" if finding.is_named else f" ({one_line(finding.about, MOST_TEXT)})"
    return f"{finding.severity:8} {finding.code}{robot}: {finding.sentence}{about}"


def make_parser(prog: str) -> Parser:
    made = Parser(
        prog=prog,
        description="Finds out what is wrong between a panel, this machine and the robot, and says what"
        " to do. It presses nothing, publishes nothing and calls no service of the robot.",
        epilog="Exit status: 0 all is well (notes do not count), 1 there are findings, 2 it could not"
        " look. docs/how-to/doctor.md lists all findings.",
    )
    add_options(made)
    made.add_argument("--json", action="store_true", help="print JSON, for programs")
    made.add_argument("-v", "--verbose", action="store_true", help="print what was found good, too")
    return made


def add_options(parser: Parser) -> None:
    """The options of `run` that a diagnosis needs, and how long it listens."""
    add = parser.add_argument
    add_settings(parser)
    add("--host", default="127.0.0.1", help="where the server listens; default: %(default)s")
    add("--port", default=8000, type=port, help="default: %(default)s")
    add(
        "--listen",
        type=seconds(LONGEST_LISTEN_S),
        default=LISTEN_S,
        metavar="SECONDS",
        help="how long to listen to the robot at most; default: %(default)g",
    )
