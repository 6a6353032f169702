"""The machines to start from as HTML: a small picture, a title and a chain each."""

import base64
import io
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from markupsafe import Markup
from PIL import Image

from warpspace.app.evaluation.machine_edits.library import MachineType
from warpspace.app.readouts.html import render
from warpspace.scene.machines import machine_picture

WIDTH_PX = 240
"""Of a small picture: it is shown smaller, sharp on fine screens too."""
QUALITY = 80
DRAWING = (0.02, 0.16, 0.6, 0.875)
"""Part of a picture in which the machine is: left, upper, right and lower end."""


def types_html(types: Sequence[MachineType], present: str, button: Callable[[str], Markup]) -> str:
    """Spell the machines to start from.

    Parameters
    ----------
    types : sequence of MachineType
    present : str
        Name of the machine that is shown.
    button : callable
        Gives the attributes of a button that sends a word.

    Returns
    -------
    str
        HTML.
    """
    return render(
        "machine_types",
        types=[(entry, small_picture(entry.name)) for entry in types],
        present=present,
        button=button,
    )


@cache
def small_picture(name: str) -> str:
    """Give the picture of a machine of the library as a data address; empty where it has none."""
    path = machine_picture(name)
    if path is None:
        return ""
    with Image.open(path) as picture:
        ends = np.array(DRAWING) * np.tile(picture.size, 2)
        small = picture.convert("RGB").crop(tuple(ends.round().astype(int).tolist()))
    small.thumbnail((WIDTH_PX, WIDTH_PX))
    buffer = io.BytesIO()
    small.save(buffer, "JPEG", quality=QUALITY)
    return f"data:image/jpeg;base64,{base64.b64encode(buffer.getvalue()).decode()}"
