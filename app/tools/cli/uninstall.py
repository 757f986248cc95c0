"""`operator-panel uninstall`: takes back what `install` did. Exit status: see
`app.tools.cli.install`."""

from argparse import Namespace
from collections.abc import Sequence

from app.tools.cli.install import add_questions, add_root, confirmed, exit_status, print_progress
from app.tools.cli.parser import USAGE_ERROR, Parser
from app.tools.install.host import Host
from app.tools.install.plan import uninstall_steps
from app.tools.install.steps import revert

PROG = "python -m app.cli uninstall"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    return exit_status(_uninstall, make_parser(prog).parse_args(arguments))


def _uninstall(options: Namespace) -> int:
    host = Host(options.root.resolve())
    plan = uninstall_steps(host)
    print("stops and removes the services, the releases, and the browser's user")
    print("keeps /etc/operator-panel, /var/lib/operator-panel (the operator's log) and the packages")
    if options.dry_run:
        return 0
    if not confirmed(options):
        return USAGE_ERROR
    revert(plan, host, print_progress)
    return 0


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Takes back what install did. Panel file, settings and the operator's log stay.",
    )
    add_questions(parser)
    add_root(parser)
    return parser
