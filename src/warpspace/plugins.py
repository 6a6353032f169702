"""Additions of other packages: figures, formats, tabs, curves and conventions they register."""

import logging
from functools import cache
from importlib.metadata import entry_points

logger = logging.getLogger(__name__)
GROUP = "warpspace.plugins"


@cache
def load_plugins() -> None:
    """Import, once, the modules that installed packages name in the entry point group.

    A module registers what it adds when it is imported, see `docs/architecture.md`. One that
    cannot be imported is left out, and logged.
    """
    for entry in entry_points(group=GROUP):
        try:
            entry.load()
        except Exception:
            logger.exception("the plug-in %s cannot be loaded and is left out", entry.name)
