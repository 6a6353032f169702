"""The tab "Concepts": machines within the same tolerances side by side."""

from warpspace.app.panels.concepts.panel import ConceptsPanel

__all__ = ["ConceptsPanel"]
