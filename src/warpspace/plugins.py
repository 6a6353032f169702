"""Additions of other packages: analyses, figures, formats, curves and conventions they register."""

import logging
from functools import cache

logger = logging.getLogger(__name__)
GROUP = "warpspace.plugins"


@cache
def load_plugins() -> None:
    """Import, once, the modules that installed packages name in the entry point group.

    A module registers what it adds when it is imported, see `docs/architecture.md`. One that
    cannot be imported is left out, and logged.
    """
    from importlib.metadata import entry_points  # a sixth of the start of a short command

    for entry in entry_points(group=GROUP):
        try:
            entry.load()
        except Exception:
            logger.exception("the plug-in %s cannot be loaded and is left out", entry.name)
