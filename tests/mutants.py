"""Break the code in every small way, one at a time, and see a test fail: `python -m tests.mutants train_client/trust.py`.

A mutant changes one comparison, operator, constant, condition, return value or call of `max` and `min`, by the syntax tree. It runs in a
process of its own, where the changed source stands in for the module and nothing on disk is touched; the tests of that module must fail.
The exit status is 1 if a mutant survives that `EQUIVALENT` does not justify.
"""

import argparse
import ast
import copy
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
LONGEST_S = 120.0
TESTS = {
    "train_client/trust.py": ["tests/unit/train/test_trust.py"],
    "train_client/alarm.py": ["tests/unit/train/test_alarm.py"],
    "train_client/stop.py": ["tests/unit/train/test_stop.py"],
    "integrity/health.py": ["tests/unit/test_health.py"],
    "integrity/lateness.py": ["tests/unit/test_lateness.py"],
    "integrity/messages/verification.py": ["tests/unit/test_verification.py", "tests/unit/test_verification_freshness.py"],
    "integrity/messages/signatures.py": ["tests/unit/test_signatures.py"],
}
# Mutants that no test can tell from the code, each with its reason; by what changed, and the line.
EQUIVALENT = {
    "age_ns < 0  ->  age_ns <= 0, in: if age_ns < 0:": "only what is not fresh is asked why, and age 0 is fresh",
    "0  ->  1, in: if age_ns < 0:": "the same: ages are whole nanoseconds",
    "0  ->  1, in: return TABLE[Input.SILENT](now, silence, 0)": "no row that silence leads to reads the time",
}
COMPARED: dict[type[ast.cmpop], list[type[ast.cmpop]]] = {
    ast.Lt: [ast.LtE, ast.GtE],
    ast.LtE: [ast.Lt, ast.Gt],
    ast.Gt: [ast.GtE, ast.LtE],
    ast.GtE: [ast.Gt, ast.Lt],
    ast.Eq: [ast.NotEq],
    ast.NotEq: [ast.Eq],
    ast.Is: [ast.IsNot],
    ast.IsNot: [ast.Is],
    ast.In: [ast.NotIn],
    ast.NotIn: [ast.In],
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.FloorDiv: ast.Mult,
    ast.Div: ast.Mult,
    ast.BitOr: ast.BitAnd,
}
RUN = """
import importlib.abc, importlib.util, pathlib, sys
name, path, source, tests = sys.argv[1], sys.argv[2], sys.stdin.read(), sys.argv[3:]
class Changed(importlib.abc.Loader):
    def exec_module(self, module):
        exec(compile(source, path, "exec"), module.__dict__)
class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, wanted, where, target=None):
        return importlib.util.spec_from_loader(name, Changed(), origin=path) if wanted == name else None
sys.meta_path.insert(0, Finder())
import pytest
sys.exit(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests]))
"""


class Mutant(NamedTuple):
    line: int
    change: str  # from, to
    source: str


def mutants(source: str) -> Iterator[Mutant]:
    """Every small change of a module, one at a time; annotations and the words of docstrings and messages are left alone."""
    tree = ast.parse(source)
    for index, node in enumerate(ast.walk(tree)):
        for other in _changed(node):
            changed = copy.deepcopy(tree)
            place = list(ast.walk(changed))[index]
            place.__class__, place.__dict__ = other.__class__, copy.deepcopy(other).__dict__ | _position(node)
            before, after = ast.unparse(node), ast.unparse(other)
            yield Mutant(getattr(node, "lineno", 0), f"{before}  ->  {after}", ast.unparse(ast.fix_missing_locations(changed)))


def _position(node: ast.AST) -> dict[str, int]:
    return {name: getattr(node, name) for name in ("lineno", "col_offset", "end_lineno", "end_col_offset") if hasattr(node, name)}


def _changed(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Compare(left, ops, comparators):
            for k, op in enumerate(ops):
                for other in COMPARED[type(op)]:
                    yield ast.Compare(left, [*ops[:k], other(), *ops[k + 1 :]], comparators)
        case ast.BinOp(left, op, right) if type(op) in COMPUTED and not (isinstance(right, ast.Constant) and right.value is None):
            yield ast.BinOp(left, COMPUTED[type(op)](), right)
        case ast.BoolOp(op, values):
            yield ast.BoolOp(ast.And() if isinstance(op, ast.Or) else ast.Or(), values)
            if len(values) > 2:
                yield from (ast.BoolOp(op, [*values[:k], *values[k + 1 :]]) for k in range(len(values)))
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield operand
        case ast.Constant(bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(int() as value):
            yield ast.Constant(value + 1)
        case ast.If(_, body, orelse) | ast.IfExp(_, body, orelse):
            for value in (True, False):
                yield type(node)(ast.Constant(value), body, orelse)  # type: ignore[arg-type]
        case ast.Call(ast.Name("max" | "min" as name), arguments, keywords):
            yield ast.Call(ast.Name("min" if name == "max" else "max", ast.Load()), arguments, keywords)
        case ast.Expr(ast.Call()) | ast.Assign([ast.Attribute()]):
            yield ast.Pass()


def survives(path: str, mutant: Mutant, tests: list[str]) -> bool:
    module = path.removesuffix(".py").replace("/", ".")
    command = [sys.executable, "-c", RUN, module, path, *tests]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        ran = subprocess.run(command, input=mutant.source, text=True, capture_output=True, cwd=ROOT, env=environment, timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        return False
    return ran.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("modules", nargs="*", default=list(TESTS), metavar="MODULE", help=f"of {', '.join(TESTS)}")
    left = 0
    for path in parser.parse_args().modules:
        source = (ROOT / path).read_text(encoding="utf-8")
        found, lines = list(mutants(source)), source.splitlines()
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            alive = list(pool.map(lambda mutant, path=path: survives(path, mutant, TESTS[path]), found))
        for mutant, lives in zip(found, alive, strict=True):
            if lives:
                why = EQUIVALENT.get(f"{mutant.change}, in: {lines[mutant.line - 1].strip()}")
                left += why is None
                print(f"{path}:{mutant.line}: {mutant.change}" + (f"\n    the same: {why}" if why else "\n    SURVIVES"))
        print(f"{path}: {len(found)} mutants, {sum(alive)} survive", flush=True)
    return int(left > 0)


if __name__ == "__main__":
    sys.exit(main())
