"""Mutants of a module: its code, changed in one place.

A change replaces a comparison, `and`, `or`, `not`, an operator, a number, a bool, `min` or `max`, or
leaves out a returned value, a branch, a call for its effect, an assignment to an attribute, a `raise`,
`continue` or `break`. Only functions and the module's constants are changed.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import Any, Final, NamedTuple

SWAPS: Final[dict[type[ast.AST], type[Any]]] = {
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE,
    ast.GtE: ast.Gt, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.And: ast.Or, ast.Or: ast.And, ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div,
    ast.Div: ast.Mult, ast.BitOr: ast.BitAnd, ast.BitAnd: ast.BitOr,
}  # fmt: skip
UNCHANGED: Final = {"annotation", "returns", "decorator_list", "defaults", "kw_defaults", "bases"}


class Mutant(NamedTuple):
    path: Path
    line: int
    change: str
    code: CodeType


def changes(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that may stand in place of this one."""
    match node:
        case ast.Compare(left=left, ops=ops, comparators=others):
            for index, operator in enumerate(ops):
                swapped = SWAPS[type(operator)]()
                yield ast.Compare(left, [*ops[:index], swapped, *ops[index + 1 :]], others)
        case ast.BoolOp(op=operator, values=values):
            yield ast.BoolOp(SWAPS[type(operator)](), values)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in SWAPS:
            yield ast.BinOp(left, SWAPS[type(operator)](), right)
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield operand
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int() | float() as value):
            yield ast.Constant(value + 1)
        case ast.Name(id="min" | "max" as name):
            yield ast.Name("max" if name == "min" else "min", ast.Load())
        case ast.Return(value=ast.expr() as value) if ast.unparse(value) != "None":
            yield ast.Return(ast.Constant(None))
        case ast.If(body=body, orelse=orelse):
            yield ast.If(ast.Constant(False), body, orelse)
        case ast.Expr(value=ast.Call() | ast.Await()) | ast.AugAssign() | ast.Raise() | ast.Delete():
            yield ast.Pass()
        case ast.Assign(targets=[ast.Attribute() | ast.Subscript()]) | ast.Continue() | ast.Break():
            yield ast.Pass()


def places(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None]]:
    """(parent, field, index) of each node in functions and constants of the module, without texts."""
    for name, value in ast.iter_fields(node):
        for index, child in enumerate(value) if isinstance(value, list) else ((None, value),):
            if name in UNCHANGED or not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr):
                continue
            if isinstance(node, ast.ClassDef) and not isinstance(child, ast.FunctionDef):
                continue
            yield node, name, index
            yield from places(child)


def mutants_of(path: Path) -> Iterator[Mutant]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for parent, name, index in [*places(tree)]:
        value = getattr(parent, name)
        node = value if index is None else value[index]
        for changed in changes(node):
            new = changed if index is None else [*value[:index], changed, *value[index + 1 :]]
            ast.fix_missing_locations(ast.copy_location(changed, node))
            setattr(parent, name, new)
            change = " → ".join(ast.unparse(n).splitlines()[0][:90] for n in (node, changed))
            yield Mutant(path, node.lineno, change, compile(tree, str(path), "exec"))
            setattr(parent, name, value)
