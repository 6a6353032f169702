"""Every example script draws its figure."""

import runpy
import sys
from pathlib import Path

import pytest

from warpspace.outputs.figures.catalogue import figure_kinds

FIGURES = tuple(kind.name for kind in figure_kinds())
EXAMPLES = Path(__file__).parents[2] / "examples"
SCRIPTS = sorted(p.stem for p in EXAMPLES.glob("*.py") if "write_figure(" in p.read_text("utf-8"))


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("name", SCRIPTS)
def test_example(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / f"{name}.png"
    monkeypatch.setattr(sys, "argv", [name, str(target)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert target.read_bytes().startswith(b"\x89PNG")


def test_every_figure_has_an_example() -> None:
    text = "".join((EXAMPLES / f"{name}.py").read_text("utf-8") for name in SCRIPTS)
    assert [name for name in FIGURES if f'"{name}"' not in text] == []
