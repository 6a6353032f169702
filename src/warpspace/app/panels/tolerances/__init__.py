"""The tab "Tolerances": limit and probability, a slider and a share per error, allocation."""

from warpspace.app.panels.tolerances.panel import TolerancesPanel

__all__ = ["TolerancesPanel"]
