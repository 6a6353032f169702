"""The window that shows what files of measured data would bring."""

from warpspace.app.panels.importing.window import ImportWindow, accepted_endings

__all__ = ["ImportWindow", "accepted_endings"]
