"""The package: public names, declared imports, what a command loads, messages of errors."""

import ast
import os
import re
import runpy
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

import warpspace
from warpspace.exceptions import (
    SHOWN_PROBLEMS,
    ChainError,
    OptionError,
    OutputError,
    RenderError,
    SceneError,
    UnknownNameError,
    WarpspaceError,
    near_miss,
    shorten,
)

ROOT = Path(__file__).parents[2]


def test_every_public_name_can_be_had():
    for name in warpspace.__all__:
        assert getattr(warpspace, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        warpspace.nonsense  # noqa: B018


def test_import_loads_the_standard_library_and_one_file():
    """What costs time at the start of a program is what is imported."""
    code = "import sys; old = {*sys.modules}; import warpspace; print(*{*sys.modules} - old)"
    command = [sys.executable, "-S", "-c", code]
    path = str(Path(warpspace.__file__).parents[1])
    found = subprocess.run(
        command, capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": path}
    )
    loaded = found.stdout.split()
    assert "warpspace" in loaded
    assert [name for name in loaded if name.split(".")[0] not in sys.stdlib_module_names] == [
        "warpspace"
    ]


def test_the_typed_program_runs():
    program = runpy.run_path(str(ROOT / "tests" / "typed" / "program.py"))
    largest, key, mean = program["main"]()
    assert (round(largest, 2), key) == (51.72, "EA0Z")
    assert 25 < mean < 32


def test_version_changelog_and_citation_agree():
    version = re.escape(warpspace.__version__)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## {version} \(.+\)$", changelog, re.MULTILINE), "CHANGELOG.md"
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(rf"^version: {version}$", citation, re.MULTILINE), "CITATION.cff"
    for key in ("cff-version", "message", "title", "authors", "license"):
        assert re.search(rf"^{key}: *\S*", citation, re.MULTILINE), key
    assert "license: MIT" in citation
    assert "MIT License" in (ROOT / "LICENSE").read_text("utf-8")


RENDERERS = "viser pyvista vtkmodules matplotlib trimesh"


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        ("", f"numpy scipy {RENDERERS}"),
        # half of what the command took was scipy.stats, which only uncertainties need
        ("field dvf5000_first --at X=0", f"scipy.stats pandas pyarrow {RENDERERS}"),
        ("field dvf5000_first --at X=0", "rich importlib.metadata numpy.random numpy.polynomial"),
        ("field dvf5000_first --at X=0", "zipfile fractions difflib warpspace.outputs.file_output"),
        ("field dvf5000_first --grid 3 -o x.npz", f"scipy.stats pandas pyarrow {RENDERERS}"),
        (
            "draw dvf5000_first --grid 3 -o x.png",
            "scipy multiprocessing pandas pyarrow warpspace.analysis.sampling.distribution",
        ),
    ],
)
def test_a_command_loads_nothing_heavy_that_it_does_not_need(arguments, heavy, tmp_path):
    code = (
        "import sys; from warpspace.cli import main; sys.argv[1:] and main();"
        f" print([n for n in {heavy.split()} if n in sys.modules])"
    )
    command = [sys.executable, "-c", code, *arguments.split()]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert found.stdout.splitlines()[-1] == "[]"


def test_near_names_are_told_ignoring_case_or_the_short_list_of_all():
    for kind in (ChainError, OptionError, OutputError, RenderError, SceneError, UnknownNameError):
        assert issubclass(kind, WarpspaceError)
    assert near_miss("eay", ["EAX", "EAY"]) == ": did you mean 'EAY' or 'EAX'?"
    assert near_miss("EA", ["EAX", "EAY", "EAZ"]).count(" or ") == 1
    assert near_miss("?", ["one", "two"]) == "; expected one of one, two"
    assert near_miss("?", [f"name{number}" for number in range(25)]) == near_miss("?", []) == ""
    error = UnknownNameError("axis", "Q", ["X", "Y"])
    assert (error.name, error.known) == ("Q", ("X", "Y"))
    assert str(error) == "unknown axis 'Q'; expected one of X, Y"


def test_one_problem_is_one_line_and_several_are_a_list_that_is_cut():
    assert str(SceneError("a.toml", ["title = 5: expected a text"])).count("\n") == 0
    error = SceneError("a.toml", ["one", "two"])
    assert str(error) == "a.toml: 2 problems\n  - one\n  - two"
    assert error.problems == ("one", "two")
    problems = [f"line {line}: {'9' * 500}" for line in range(SHOWN_PROBLEMS + 3)]
    error = SceneError("a.toml", problems)
    head, *shown, last = str(error).splitlines()
    assert (head, last) == (f"a.toml: {len(problems)} problems", "  … and 3 more")
    nines = f"{'9' * 10}…{'9' * 10}"
    assert shown == [f"  - line {line}: {nines}" for line in range(SHOWN_PROBLEMS)]
    assert len(error.problems) == len(problems)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"P{'9' * 300}; expected less", "P9999999999…9999999999; expected less"),
        ("1234567890" * 30 + " points", "1234567890…1234567890 points"),
        (f"{'a' * 5000} is unknown", f"{'a' * 80}…{'a' * 80} is unknown"),
        (f"/{'folder/' * 25}scene.toml: no such file", None),
        ("word " * 5000, f"{'word ' * 400}…{'word ' * 16}"),
        ("line\n" * 1000, None),
    ],
)
def test_endless_numbers_words_and_lines_are_shortened_everywhere(text, expected):
    expected = text if expected is None else expected
    assert shorten(text) == expected
    assert str(OptionError(text)) == OptionError(text).with_names(str) == expected


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
