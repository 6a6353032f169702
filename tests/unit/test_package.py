"""The public names of the package."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

import warpspace

ROOT = Path(__file__).parents[2]


def test_every_public_name_can_be_had() -> None:
    for name in warpspace.__all__:
        assert getattr(warpspace, name) is not None


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        warpspace.nonsense  # noqa: B018


def test_import_loads_nothing_heavy() -> None:
    heavy = "numpy pydantic viser pyvista vtk matplotlib trimesh scipy"
    code = f"import sys, warpspace; print([n for n in {heavy.split()} if n in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_import_loads_the_standard_library_and_one_file() -> None:
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


def test_help_of_the_command_line_loads_no_numerics_and_no_renderer() -> None:
    heavy = "numpy pydantic viser pyvista vtk matplotlib trimesh scipy"
    code = f"import sys, warpspace.cli; print([n for n in {heavy.split()} if n in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_the_typed_program_runs() -> None:
    program = runpy.run_path(str(ROOT / "tests" / "typed" / "program.py"))
    largest, key, mean = program["main"]()
    assert (round(largest, 2), key) == (51.72, "EA0Z")
    assert 25 < mean < 32


def test_version_changelog_and_citation_agree() -> None:
    version = re.escape(warpspace.__version__)
    changelog = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## {version} \(.+\)$", changelog, re.MULTILINE), "CHANGELOG.md"
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.search(rf"^version: {version}$", citation, re.MULTILINE), "CITATION.cff"
    for key in ("cff-version", "message", "title", "authors", "license"):
        assert re.search(rf"^{key}: *\S*", citation, re.MULTILINE), key
    assert "license: MIT" in citation
    assert "MIT License" in (ROOT / "LICENSE").read_text("utf-8")


@pytest.mark.parametrize("options", [("--at", "X=0"), ("--grid", "3", "-o", "x.npz")])
def test_a_field_loads_no_statistics_of_scipy_and_no_renderer(
    options: tuple[str, ...], tmp_path: Path
) -> None:
    """Half of what the command took was scipy.stats, which only uncertainties need."""
    heavy = "scipy.stats viser pyvista vtkmodules matplotlib trimesh pandas pyarrow"
    code = (
        "import sys; from warpspace.cli import main; main();"
        f" print([n for n in {heavy.split()} if n in sys.modules])"
    )
    command = [sys.executable, "-c", code, "field", "dvf5000_first", *options]
    found = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert found.stdout.splitlines()[-1] == "[]"
