"""The tab "Compensate": a table for the control, and the error that it leaves."""

from warpspace.app.panels.compensate.panel import CompensatePanel

__all__ = ["CompensatePanel"]
