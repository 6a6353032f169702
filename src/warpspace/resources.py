"""Where the bundled scenes and machines are, in a wheel as in a checkout."""

from pathlib import Path

_PACKAGE_DIR = Path(__file__).resolve().parent


def _data_root() -> Path:
    """Folder that holds ``scenes`` and ``assets``.

    Returns
    -------
    Path
        ``_data`` inside the package where a wheel was installed, else the top level of the
        repository that the package is run from.
    """
    installed = _PACKAGE_DIR / "_data"
    return installed if installed.is_dir() else _PACKAGE_DIR.parents[1]


def scenes_dir() -> Path:
    """Folder of the bundled scenes.

    Returns
    -------
    Path
        Absolute; holds one ``<name>.toml`` a scene.
    """
    return _data_root() / "scenes"


def assets_dir() -> Path:
    """Folder of the bundled assets.

    Returns
    -------
    Path
        Absolute; holds ``machines/<name>/machine.toml`` and what belongs to each machine.
    """
    return _data_root() / "assets"
