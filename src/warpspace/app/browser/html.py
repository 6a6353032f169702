"""HTML: escaped text, attributes, and elements that are rendered too often for a template.

Every text that is not `Markup` is escaped here. The other elements are macros of
`templates/elements.html.j2`. An element sends an action, see `actions.py`.
"""

import re
from base64 import b64encode
from collections.abc import Iterable
from functools import lru_cache
from html import escape

import msgspec
from markupsafe import Markup

from warpspace.app.browser.actions import AnyAction
from warpspace.resources import scenes_dir
from warpspace.scene.library import scene_names
from warpspace.units import spell_change, spell_fixed

EMPTY = Markup("")


def text(value: object) -> str:
    """Escape a text that is not `Markup`; `markupsafe.escape` takes three to ten times as long."""
    return value if isinstance(value, Markup) else escape(str(value))


def fill(template: str, /, *values: object, **named: object) -> Markup:
    """Format a template; values that are not `Markup` are escaped."""
    escaped = {name: text(value) for name, value in named.items()}
    return Markup(template.format(*map(text, values), **escaped))  # noqa: S704


def join(parts: Iterable[object]) -> Markup:
    return Markup("".join(map(text, parts)))  # noqa: S704 - escaped there


def attributes(**values: object) -> Markup:
    """Format attributes; None and False omit one, True gives no value, ``_`` becomes ``-``."""
    markup = ""
    for name, value in values.items():
        if value is not None and value is not False:
            markup += f" {name.strip('_').replace('_', '-')}"
            markup += "" if value is True else f'="{text(value)}"'
    return Markup(markup)  # noqa: S704 - escaped here


def tag(name: str, body: object = "", **values: object) -> Markup:
    return Markup(f"<{name}{attributes(**values)}>{text(body)}</{name}>")  # noqa: S704


number, signed = spell_fixed, spell_change


def lowered(text: str) -> Markup:
    """Render the letter after an underscore as a subscript: |E_B − E_A|."""
    return Markup(re.sub("_(.)", r"<sub>\1</sub>", str(escape(text))))  # noqa: S704 - escaped before


_LINK = re.compile(r"(https?://[^\s<>\"']+[^\s<>\"'.,;:!?)\]])")


def linked(source: str) -> Markup:
    """Render the text of a user; http and https addresses become links."""
    parts = _LINK.split(source)
    return join(
        tag("a", part, href=part, target="_blank", rel="noopener noreferrer") if i % 2 else part
        for i, part in enumerate(parts)
    )


# --- Controls -------------------------------------------------------------------------------------


def ident(name: AnyAction | str) -> str:
    """Return the id of the element that sends an action, or has a name."""
    if isinstance(name, msgspec.Struct):
        name = "-".join((type(name).__name__, *filter(None, msgspec.structs.astuple(name))))
    return "ws-" + re.sub(r"[^0-9A-Za-z]+", "-", name)


def slider(name: AnyAction, value: float | str, low: float, high: float, step: float, *,
           label: str = "", twin: AnyAction | str = "", text: str = "") -> Markup:  # fmt: skip
    """Render a slider; `twin` is the number box that receives digits typed on the slider."""
    values = attributes(
        type="range", id=None if not label else ident(name) + "-slider", class_="ws-slider",
        min=f"{low:g}", max=f"{high:g}", step=f"{step:g}",
        value=value if isinstance(value, str) else f"{value:.10g}", data_set=name,
        data_twin=ident(twin) if twin else None, aria_label=label or None,
        aria_valuetext=text or None,
    )  # fmt: skip
    return Markup(f"<input{values}>")  # noqa: S704 - escaped there


@lru_cache(maxsize=64)
def thumbnail(name: str) -> Markup:
    """Render the picture of a bundled scene; an empty box for others."""
    path = scenes_dir() / "thumbnails" / f"{name}.webp"
    if name not in scene_names() or not path.is_file():
        return tag("i", class_="ws-thumbnail")
    data = b64encode(path.read_bytes()).decode()
    return tag("img", class_="ws-thumbnail", src=f"data:image/webp;base64,{data}", alt="")
