"""The tab "Machine editor": chain, order, sides and sizes of the machine that is shown."""

from warpspace.app.panels.machine_editor.panel import MachineEditorPanel

__all__ = ["MachineEditorPanel"]
