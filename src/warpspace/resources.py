"""Resources of the package: version, bundled scenes and machines."""

from pathlib import Path

from warpspace.exceptions import WarpspaceError

__version__ = "0.1.0"
RENDERER_MB = 1600  # address space of the renderer for a picture
GARBAGE_THRESHOLDS = 50_000, 5, 5  # of a command or drawing: loading modules leaves no garbage
_PACKAGE_DIR = Path(__file__).resolve().parent


def _data_root() -> Path:
    installed = _PACKAGE_DIR / "_data"
    return installed if installed.is_dir() else _PACKAGE_DIR.parents[1]


def scenes_dir() -> Path:
    return _data_root() / "scenes"


def assets_dir() -> Path:
    return _data_root() / "assets"


def find_data(name: str) -> Path:
    """Find a file of readings: a path, or the name of a bundled one such as ``tcp_on.csv``."""
    path = Path(name)
    if path.exists() or path.name != name:
        return path
    bundled = sorted((assets_dir() / "measurements").glob(f"*/{name}"))
    return bundled[0] if bundled else path


def check_address_space(least_mb: int, what: str) -> None:
    """Refuse work where libraries would abort for want of address space (``ulimit -v``)."""
    try:
        import resource
    except ImportError:  # this system has no such limit
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if 0 <= limit < least_mb * 1_000_000:
        raise WarpspaceError(
            f"not enough memory: the address space is limited to {limit / 1e6:.0f} MB (ulimit -v);"
            f" {what} needs at least {least_mb} MB"
        )
