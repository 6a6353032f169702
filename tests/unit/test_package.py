"""The public names of the package."""

import subprocess
import sys

import pytest

import warpspace


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


def test_help_of_the_command_line_loads_no_numerics_and_no_renderer() -> None:
    heavy = "numpy pydantic viser pyvista vtk matplotlib trimesh scipy"
    code = f"import sys, warpspace.cli; print([n for n in {heavy.split()} if n in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
