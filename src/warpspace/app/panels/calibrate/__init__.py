"""The tab "Calibrate": the errors of the machine out of readings."""

from warpspace.app.panels.calibrate.panel import CalibratePanel

__all__ = ["CalibratePanel"]
