"""Every example script draws its figure, or writes what it says."""

import runpy
import sys
from pathlib import Path

import pytest

from products import first
from warpspace.outputs.figures.registry import figure_kinds

FIGURES = tuple(kind.name for kind in figure_kinds())
EXAMPLES = Path(__file__).parents[2] / "examples"
WRITES = {
    "exports": ("dvf5000_first.glb", "dvf5000_first.vts", "dvf5000_first.csv"),
    "design_review": ("review.pdf",),
    "animation": ("bend.webp",),
    "acceptance": ("acceptance.png", "acceptance.webp"),
}
SCRIPTS = sorted(p.stem for p in EXAMPLES.glob("*.py") if "write_figure(" in p.read_text("utf-8"))


@pytest.mark.render
@pytest.mark.usefixtures("renderer")
@pytest.mark.parametrize("name", [*first(*SCRIPTS), "own_plotter", *first(*WRITES)])
def test_example(name, tmp_path, monkeypatch):
    target = tmp_path if name in WRITES else tmp_path / f"{name}.png"
    monkeypatch.setattr(sys, "argv", [name, str(target)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    written = sorted(path.name for path in tmp_path.iterdir())
    assert written == sorted(WRITES.get(name, (f"{name}.png",)))
    assert name in WRITES or target.read_bytes().startswith(b"\x89PNG")


def test_every_figure_has_an_example():
    text = "".join((EXAMPLES / f"{name}.py").read_text("utf-8") for name in SCRIPTS)
    assert [name for name in FIGURES if f'"{name}"' not in text] == []
