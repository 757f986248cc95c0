"""`operator-panel sbom`: what is installed, as an SBOM; with `--check` what a VEX file says of it.

Exit status: 0 nothing installed is affected, 1 something is, 2 a mistake on the command line, a file
that can't be used, or a signature that does not fit.
"""

import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.system.errors import KioskError
from app.system.inventory import Component, cyclonedx, installed, system_packages
from app.system.minisign import PINNED
from app.system.vex import STATUSES, Verdict, Vex, read_signed_vex, read_vex, verdicts
from app.tools.cli.output import add_force, check_absent, draft_of
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli sbom"
UNAFFECTED, AFFECTED, UNKNOWN = range(3)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        components = (*installed(), *(() if options.python_only else system_packages()))
        if options.check is None:
            _write(components, options.output, options.force)
            return UNAFFECTED
        return _check(
            components, options.check, None if options.unsigned else options.key, options.json
        )
    except KioskError as error:
        print(error, file=sys.stderr)
        return UNKNOWN


def _write(components: Sequence[Component], file: Path | None, force: bool) -> None:
    text = json.dumps(cyclonedx(components), indent=2, ensure_ascii=False) + "\n"
    if file is None:
        print(text, end="")
        return
    check_absent(file, force)
    with draft_of(file, force) as draft:
        draft.write_text(text, encoding="utf-8")
    print(f"{file}: {len(components)} components")


def _check(components: Sequence[Component], file: Path, keys: Path | None, as_json: bool) -> int:
    """Without `keys` the signature is not checked."""
    if keys is None:
        vex, signed = read_vex(file), f"the signature of {file.name} is not checked (--unsigned)"
    else:
        vex, signed = read_signed_vex(file, keys)
    judged = verdicts(vex, components)
    if as_json:
        print(json.dumps(_as_json(vex, signed, judged), indent=2, ensure_ascii=False))
    else:
        print("\n".join(_as_lines(vex, signed, judged, components)))
    return AFFECTED if any(each.status == "affected" for each in judged) else UNAFFECTED


def _as_lines(
    vex: Vex, signed: str, judged: Sequence[Verdict], components: Sequence[Component]
) -> list[str]:
    own = components[0]
    lines = [signed]
    if not own.version:
        lines.append(
            f"{own.name} is a checkout without a version: statements about its versions are left out"
        )
    for each in judged:
        detail = f": {each.detail}" if each.detail else ""
        lines.append(f"{each.status:20}{each.weakness} in {each.component}{detail}")
    counts = Counter(each.status for each in judged)
    told = ", ".join(f"{counts[status]} {status}" for status in STATUSES if counts[status])
    lines.append(
        f"{len(vex.statements)} statements of {vex.at.date().isoformat()} by {vex.author};"
        f" about what is installed: {told or 'none'}"
    )
    return lines


def _as_json(vex: Vex, signed: str, judged: Sequence[Verdict]) -> dict[str, Any]:
    return {
        "author": vex.author,
        "timestamp": vex.at.isoformat(),
        "signature": signed,
        "statements": len(vex.statements),
        "verdicts": [
            {
                "vulnerability": each.weakness,
                "component": each.component.purl,
                "status": each.status,
                "detail": each.detail,
            }
            for each in judged
        ],
    }


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Prints what is installed with this program as an SBOM (CycloneDX 1.6): the"
        " packages of its Python environment, from their own metadata, the interpreter, and on Debian"
        " and its kin the packages of the operating system. With --check it compares that with"
        " the VEX file of a release (OpenVEX), offline.",
        epilog="Exit status: 0 nothing installed is affected, 1 something is, 2 a mistake on the"
        " command line, a file that can't be used, or a signature that does not fit.",
    )
    add = parser.add_argument
    add("-o", "--output", type=Path, metavar="FILE", help="default: the SBOM is printed")
    add_force(parser)
    add("--python-only", action="store_true", help="without the packages of the operating system")
    add(
        "--check",
        type=Path,
        metavar="VEX",
        help="an OpenVEX file, with its signature beside it (.minisig)",
    )
    add(
        "--key",
        type=Path,
        default=Path(PINNED),
        metavar="FILE",
        help="the public keys that VEX may be signed with; default: %(default)s",
    )
    add("--unsigned", action="store_true", help="take a VEX file without a signature")
    add("--json", action="store_true", help="with --check: print JSON, for programs")
    return parser
