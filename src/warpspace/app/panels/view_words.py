"""What the view panel calls things, and which value each name stands for."""

from collections.abc import Mapping

from warpspace.kinematics.model import Loop

COMPONENT_NAMES = {
    "position": {"norm": "|E| length", "x": "E_x", "y": "E_y", "z": "E_z"},
    "orientation": {
        "norm": "|φ| tilt of the tool axis",
        "x": "φ_x tilt about x",
        "y": "φ_y tilt about y",
        "z": "φ_z tilt about z",
    },
}
"""What the components are called, for each quantity that can be coloured."""
LOOP_NAMES = {
    Loop.TOOL.value: "tool point",
    Loop.WORKPIECE.value: "workpiece point",
    Loop.RELATIVE.value: "tool relative to workpiece",
}
SWITCHES = {
    "traces": ("Rotary traces", "Circles and arcs of the table: nominal light, actual dark."),
    "ghost": ("Nominal box", "The working volume without errors, dashed."),
    "grid_lines": ("Grid lines", "Lines of the grid on the deformed box."),
    "axes": ("Axes", "Coordinates of the machine in mm."),
    "dark": ("Dark mode", "Light lines on a dark ground; the colours of the map stay."),
}


class Names:
    """Words shown for the values of a dropdown, both ways."""

    def __init__(self, shown: Mapping[str, str]) -> None:
        self._shown = dict(shown)
        self._value = {text: value for value, text in shown.items()}

    @property
    def options(self) -> tuple[str, ...]:
        """All words."""
        return tuple(self._value)

    def text(self, value: str) -> str:
        """Give the words for a value."""
        return self._shown.get(value, value)

    def value(self, text: str) -> str:
        """Give the value that words stand for."""
        return self._value.get(text, text)


def component_of(text: str) -> str:
    """Give the component that a name stands for, whatever is coloured meanwhile; else the text."""
    for names in COMPONENT_NAMES.values():
        for component, name in names.items():
            if name == text:
                return component
    return text
