"""Panels of the page: error list, top bar, overlay of the drawing, tasks and dialogs."""
