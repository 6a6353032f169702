"""The examples of exports, report and animation do what they say."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
WRITES = {
    "exports": ("dvf5000_first.glb", "dvf5000_first.vts", "dvf5000_first.csv"),
    "design_review": ("review.pdf",),
    "animation": ("bend.webp",),
}


@pytest.mark.render
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.proof) if n == "design_review" else n for n in WRITES],
)
def test_example(name: str, renderer: str, tmp_path: Path) -> None:
    script = EXAMPLES / f"{name}.py"
    run = subprocess.run(
        [sys.executable, str(script), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert run.returncode == 0, run.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(WRITES[name])
