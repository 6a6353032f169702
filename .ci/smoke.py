"""Try an installed warpspace: version, numbers, a picture, exports, report, the app, Python.

    python smoke.py VERSION

Run by the Python of the environment it is installed in, in an empty folder.
"""

import json
import os
import re
import subprocess
import sys
import time
import urllib.request
from importlib import metadata
from pathlib import Path

COMMAND = Path(sys.executable).parent / "warpspace"
PATIENCE_S = 1200


def warpspace(*arguments: str) -> str:
    """Run a command and give what it prints."""
    done = subprocess.run(
        [COMMAND, *arguments], capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, f"{arguments}: {done.stderr}"
    return done.stdout


def check_commands(version: str) -> None:
    """Try what is typed."""
    assert warpspace("--version").split()[-1] == version
    field = json.loads(warpspace("field", "dvf5000_first", "--grid", "11", "--json"))
    assert abs(field["statistics"]["max_um"] - 51.72) < 0.005, field["statistics"]
    assert "valid" in warpspace("check", "dvf5000_first")
    for ending in ("glb", "vts", "csv", "html"):
        warpspace("export", "dvf5000_first", "-o", f"scene.{ending}", "--grid", "7")
        assert Path(f"scene.{ending}").stat().st_size > 1000
    warpspace("report", "dvf5000_first", "-o", "review.pdf", "--samples", "2000", "--grid", "7")
    assert Path("review.pdf").read_bytes().startswith(b"%PDF")
    warpspace("contributions", "dvf5000_proposed", "--sobol", "64")
    warpspace("draw", "dvf5000_first", "-o", "bend.gif", "--frames", "2", "--size", "480x360")


def check_python() -> None:
    """Try what is imported."""
    import warpspace as package

    scene = package.load_scene("dvf5000_first")
    field = package.evaluate(scene, grid=11)
    assert abs(float(field.norm_um.mean()) - 31.66) < 0.005
    assert package.gains(scene)[0].norm > 1.0
    assert package.to_pyvista(scene, grid=5)["surface"].n_points > 0
    result = package.montecarlo(package.load_scene("dvf5000_general"), loop="tool", samples=20_000)
    assert 40 < result.mean_um < 43


def draw_first() -> float:
    """Draw a picture and give the seconds it took."""
    began = time.monotonic()
    warpspace("draw", "dvf5000_first", "-o", "map.png", "--size", "800x600")
    assert Path("map.png").read_bytes().startswith(b"\x89PNG")
    return time.monotonic() - began


def check_app() -> float:
    """Start the app, get its page, end it; give the seconds until the page was there."""
    command = [COMMAND, "view", "dvf5000_first", "--no-browser"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    began = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as app:
        try:
            assert app.stdout is not None
            for line in app.stdout:
                if found := re.search(r"http://[^\s/]+", line):
                    break
            else:
                raise AssertionError("the app printed no address")
            with urllib.request.urlopen(found.group(0) + "/", timeout=60) as page:
                assert page.status == 200
                assert b"<html" in page.read().lower()
            return time.monotonic() - began
        finally:
            app.terminate()
            app.wait(timeout=60)


def main() -> None:
    """Try everything, and say with what."""
    picture_s = draw_first()
    page_s = check_app()
    check_commands(sys.argv[1])
    check_python()
    names = (
        "numpy",
        "scipy",
        "pyvista",
        "vtk",
        "matplotlib",
        "viser",
        "trimesh",
        "click",
    )
    print(f"first picture after {picture_s:.1f} s, first page after {page_s:.1f} s")
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in names)
    print(f"Python {sys.version.split()[0]}: works with {versions}")


if __name__ == "__main__":
    main()
