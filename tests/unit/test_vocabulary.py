"""Limits that keep names and docstrings of the package to the terms of the trade (GLOSSARY.md)."""

import ast
import re
from collections import Counter
from pathlib import Path

SRC = Path(__file__).parents[2] / "src" / "warpspace"
PLACEHOLDERS = """
found one own told said sure doubt doubts asked known taken kept held left given written shown said_of seen spelled
acting wanted meant every both others more most few those these way ways words thing things here there then anew alone
together among amid beside over around whole rest back further ask
"""  # noqa: E501
GENERIC = "result results value values item items data obj res tmp info output ret entry element"
OPENINGS = "give say tell what whether how who where which that"
LIMITS = {
    "placeholders": 120, "generic": 800, "openings": 15, "classes": 4, "modules": 12,
    "walrus": 70, "local imports": 160, "former": 3, "modules in a folder": 18, "cycles": 0,
}  # fmt: skip
DOCUMENTED = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef | ast.Module


def short_lived(tree: ast.AST) -> set[tuple[str, int]]:
    """Return the names of comprehensions and lambdas, which may be short."""
    names = set()
    for node in ast.walk(tree):
        for part in getattr(node, "generators", ()):
            names |= {(n.id, n.lineno) for n in ast.walk(part.target) if isinstance(n, ast.Name)}
        if isinstance(node, ast.Lambda):
            names |= {(argument.arg, argument.lineno) for argument in node.args.args}
    return names


def defined_names(tree: ast.AST):
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno


def count_cycles(imports: dict[str, set[str]]) -> int:
    """Return how many modules lie between or on cycles of imports."""
    left = dict(imports)
    while free := [name for name, targets in left.items() if not targets & left.keys() - {name}]:
        for name in free:
            del left[name]
    while free := [n for n in left if not any(n in left[m] for m in left if m != n)]:
        for name in free:
            del left[name]
    return len(left)


def counts() -> Counter[str]:
    counted: Counter[str] = Counter()
    placeholders, generic, openings = (set(s.split()) for s in (PLACEHOLDERS, GENERIC, OPENINGS))
    classes, stems, folders, imports = Counter(), Counter(), Counter(), {}
    trees = {path: ast.parse(path.read_text("utf-8")) for path in sorted(SRC.rglob("*.py"))}
    names = {path: ".".join(path.relative_to(SRC).with_suffix("").parts) for path in trees}
    for path, tree in trees.items():
        is_module = path.stem not in {"__init__", "__main__"}
        stems[path.stem] += is_module
        folders[path.parent] += is_module
        counted["former"] += len(re.findall(r"\b[Ff]ormer|Renamed", path.read_text("utf-8")))
        short = short_lived(tree)
        for name, line in defined_names(tree):
            if (name, line) not in short:
                counted["placeholders"] += name.strip("_").lower() in placeholders
                counted["generic"] += name.strip("_").lower() in generic
        targets = imports.setdefault(names[path], set())
        for node in ast.walk(tree):
            counted["walrus"] += isinstance(node, ast.NamedExpr)
            if isinstance(node, ast.ClassDef):
                classes[node.name.lstrip("_")] += 1
            if isinstance(node, DOCUMENTED):
                first = re.match(r"[A-Za-z]+", ast.get_docstring(node) or "")
                counted["openings"] += bool(first and first[0].lower() in openings)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                inner = (n for n in ast.walk(node) if isinstance(n, ast.Import | ast.ImportFrom))
                counted["local imports"] += sum(1 for _ in inner)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("warpspace."):
                home = node.module.removeprefix("warpspace.")
                parts = {f"{home}.{alias.name}" for alias in node.names}
                targets |= (parts & set(names.values())) or {home} & set(names.values())
    counted["classes"] = sum(count > 1 for count in classes.values())
    counted["modules"] = sum(count > 1 for count in stems.values())
    counted["modules in a folder"] = max(folders.values())
    counted["cycles"] = count_cycles(imports)
    return counted


def test_names_stay_within_the_vocabulary():
    counted = counts()
    assert {kind: counted[kind] for kind in LIMITS if counted[kind] > LIMITS[kind]} == {}
