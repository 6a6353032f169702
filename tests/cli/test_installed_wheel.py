"""The wheel works by itself: installed, run from another folder, with its own scenes."""

import os
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
# The dependencies are borrowed from the running interpreter's site-packages. A path in a .pth
# file does not run the .pth files found there, so the editable install stays out of sight.
BORROWED = sysconfig.get_path("purelib"), sysconfig.get_path("platlib")


def run(command, folder):
    kept = {k: v for k, v in os.environ.items() if k not in {"PYTHONPATH", "PYTHONHOME"}}
    how = {"cwd": folder, "env": kept, "timeout": 240, "text": True}
    result = subprocess.run(command, capture_output=True, check=False, **how)
    assert result.returncode == 0, f"{command}\n{result.stdout}\n{result.stderr}"
    return result.stdout


@dataclass(frozen=True)
class Installation:
    bin: Path
    root: Path
    elsewhere: Path

    def python(self, *arguments):
        return run([self.bin / "python", *arguments], self.elsewhere)

    def warpspace(self, *arguments):
        return run([self.bin / "warpspace", *arguments], self.elsewhere)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--no-deps"]
    run([*pip, "--no-build-isolation", "--wheel-dir", str(folder), str(REPOSITORY)], folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installation(wheel, tmp_path_factory):
    root = tmp_path_factory.mktemp("installed")
    venv.create(root, with_pip=False, symlinks=True)
    python = root / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", str(python)]
    run([*pip, "install", "--no-deps", "--no-index", str(wheel)], root)
    (site_packages,) = root.glob("lib/python*/site-packages")
    borrowed = "\n".join(dict.fromkeys(BORROWED))
    (site_packages / "borrowed.pth").write_text(borrowed + "\n", encoding="utf-8")
    return Installation(python.parent, root, tmp_path_factory.mktemp("elsewhere"))


def bundled():
    files = (
        path.relative_to(REPOSITORY).as_posix()
        for folder in ("scenes", "assets")
        for path in (REPOSITORY / folder).rglob("*.toml")
    )
    return sorted(files)


def test_wheel_carries_scenes_and_machines(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert "warpspace/py.typed" in names
    assert bundled()
    assert {f"warpspace/_data/{name}" for name in bundled()} <= names


def test_sdist_carries_scenes_and_machines(tmp_path):
    build = "import sys; from hatchling.build import build_sdist; build_sdist(sys.argv[1])"
    run([sys.executable, "-c", build, str(tmp_path)], REPOSITORY)
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert set(bundled()) <= names


def test_elsewhere_the_program_has_the_scenes_it_was_installed_with(installation):
    code = "from warpspace import resources as r; print(r.scenes_dir(), r.assets_dir(), sep='\\n')"
    folders = [Path(line) for line in installation.python("-c", code).splitlines()]
    assert all(folder.is_relative_to(installation.root.resolve()) for folder in folders)
    assert all(folder.is_dir() for folder in folders)
    assert "dvf5000_first" in installation.python("-m", "warpspace", "list")
    installation.warpspace("check", "dvf5000_first")
