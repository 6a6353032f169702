"""Every package that the source imports is declared in pyproject.toml."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = ("cluster", "urdf", "video")
INDIRECT = {"vtk"}  # pyvista without VTK does not exist; it decides on the version


def distribution(name):
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower()


def imported():
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                yield from (alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                yield node.module


def test_every_import_is_declared():
    names = {name.partition(".")[0] for name in imported()} - sys.stdlib_module_names
    distributions = packages_distributions()
    needed = {distribution(distributions[name][0]) for name in names - {"warpspace"}}
    lists = [PROJECT["dependencies"], *map(PROJECT["optional-dependencies"].get, EXTRAS)]
    declared = {distribution(entry) for entries in lists for entry in entries}
    assert needed - declared - INDIRECT == set()
