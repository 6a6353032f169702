"""Where the bundled scenes and machines lie."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent
_INSTALLED = _PACKAGE / "_data"


def _root() -> Path:
    """Folder that holds `scenes` and `assets`: inside a wheel, or the top of the repository."""
    return _INSTALLED if _INSTALLED.is_dir() else _PACKAGE.parents[1]


def scenes_dir() -> Path:
    """Give the folder of the bundled scenes."""
    return _root() / "scenes"


def assets_dir() -> Path:
    """Give the folder of the bundled machines."""
    return _root() / "assets"
