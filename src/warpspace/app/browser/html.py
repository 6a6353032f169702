"""Pieces of HTML that a page consists of: buttons, number boxes, sliders, choices, sections.

Every text is escaped here; only what is `Markup` already goes in as it is. What an element sends is
an event, ``part:word`` with a value, see `events.py`.
"""

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from html import escape

from markupsafe import Markup

from warpspace.units import MINUS

EMPTY = Markup("")


def text(value: object) -> str:
    """Escape what is no `Markup`; that of `markupsafe` itself takes three to ten times as long."""
    return value if isinstance(value, Markup) else escape(str(value))


def fill(template: str, /, *values: object, **named: object) -> Markup:
    """Fill in a template; every value that is no `Markup` is escaped."""
    escaped = {name: text(value) for name, value in named.items()}
    return Markup(template.format(*map(text, values), **escaped))  # noqa: S704


def join(parts: Iterable[object]) -> Markup:
    return Markup("".join(map(text, parts)))  # noqa: S704 - escaped there


def attributes(**values: object) -> Markup:
    """Spell attributes; None and False leave one out, True needs no value, ``_`` becomes ``-``."""
    markup = "".join(
        f" {_spelt(name)}" if value is True else f' {_spelt(name)}="{text(value)}"'
        for name, value in values.items()
        if value is not None and value is not False
    )
    return Markup(markup)  # noqa: S704 - escaped here


@lru_cache(maxsize=256)
def _spelt(name: str) -> str:
    return name.strip("_").replace("_", "-")


def tag(name: str, body: object = "", **values: object) -> Markup:
    return Markup(f"<{name}{attributes(**values)}>{text(body)}</{name}>")  # noqa: S704


def button(
    label: object,
    do: str,
    value: object = None,
    *,
    kind: str = "",
    hint: str = "",
    pressed: bool | None = None,
    disabled: bool = False,
    **extra: object,
) -> Markup:
    """Give a button that sends an event; `kind` is "", "main", "quiet" or "link"."""
    state = None if pressed is None else str(pressed).lower()
    return tag(
        "button", label, type="button", class_=f"ws-button {kind}".strip(), data_do=do,
        data_value=value, title=hint or None, aria_pressed=state, disabled=disabled, **extra,
    )  # fmt: skip


def upload_button(
    label: str, part: str, most_bytes: int, endings: str, *, hint: str, kind: str = ""
) -> Markup:
    """Give a button that opens a chooser of files, which come as events ``part:file``."""
    return tag(
        "button", label, type="button", class_=f"ws-button {kind}".strip(), data_upload=part,
        data_most=most_bytes, data_accept=endings, title=hint,
    )  # fmt: skip


def number(value: float, digits: int = 1) -> str:
    """Spell a number for people: a true minus, no minus before a zero."""
    text = f"{value:.{digits}f}"
    if float(text) == 0.0:
        text = text.lstrip("-")
    return text.replace("-", MINUS)


def signed(value: float, digits: int = 1) -> str:
    """Spell a number with its sign; zero has none."""
    text = number(value, digits)
    return text if text.startswith(MINUS) or not float(text.replace(MINUS, "-")) else f"+{text}"


def lowered(text: str) -> Markup:
    """Set the letter behind an underscore lower: |E_B − E_A|."""
    return Markup(re.sub("_(.)", r"<sub>\1</sub>", str(escape(text))))  # noqa: S704 - escaped before


_LINK = re.compile(r"(https?://[^\s<>\"']+[^\s<>\"'.,;:!?)\]])")


def linked(source: str) -> Markup:
    """Give what somebody has written, with links made of addresses of http and https alone."""
    parts = _LINK.split(source)
    return join(
        tag("a", part, href=part, target="_blank", rel="noopener noreferrer") if i % 2 else part
        for i, part in enumerate(parts)
    )


# --- What can be set ------------------------------------------------------------------------------


def ident(name: str) -> str:
    """Give an element's id for an event's name."""
    return "ws-" + re.sub(r"[^0-9A-Za-z]+", "-", name)


def field(label: object, control: Markup, name: str, unit: str = "", hint: str = "") -> Markup:
    """Give a labelled control; its unit stands behind it."""
    return fill(
        '<div class="ws-field"{title}><label for="{id}">{label}</label>{control}{unit}</div>',
        title=attributes(title=hint or None), id=ident(name), label=label, control=control,
        unit=tag("span", unit, class_="ws-unit") if unit else EMPTY,
    )  # fmt: skip


def _input(**values: object) -> Markup:
    return Markup(f"<input{attributes(**values)}>")  # noqa: S704 - escaped there


def text_box(name: str, value: str, *, placeholder: str = "", live: bool = False,
             label: str = "", size: str = "", **extra: object) -> Markup:  # fmt: skip
    """Give a box that sends what was typed on Enter or when it is left; `live` with each letter."""
    return _input(
        type="text", id=extra.pop("id", ident(name)), class_=f"ws-box {size}".strip(), value=value,
        data_set=name, data_live=name if live else None, placeholder=placeholder or None,
        aria_label=label or None, autocomplete="off", spellcheck="false", **extra,
    )  # fmt: skip


def slider(name: str, value: float | str, low: float, high: float, step: float, *,
           label: str = "", twin: str = "", text: str = "") -> Markup:  # fmt: skip
    """Give a slider; `twin` is the name of the number box that digits typed on it go into."""
    return _input(
        type="range", id=None if not label else ident(name) + "-slider", class_="ws-slider",
        min=f"{low:g}", max=f"{high:g}", step=f"{step:g}",
        value=value if isinstance(value, str) else f"{value:.10g}", data_set=name,
        data_twin=ident(twin) if twin else None, aria_label=label or None,
        aria_valuetext=text or None,
    )  # fmt: skip


def choice(name: str, value: str, labels: Mapping[str, str], *, label: str = "") -> Markup:
    options = join(
        tag("option", said, value=key, selected=key == value) for key, said in labels.items()
    )
    return tag(
        "select", options, id=ident(name), class_="ws-box", data_set=name, aria_label=label or None
    )


def switch(name: str, label: object, *, on: bool, hint: str = "") -> Markup:
    box = _input(type="checkbox", id=ident(name), checked=on, data_set=name)
    return tag("label", join((box, " ", label)), class_="ws-switch", title=hint or None)


def fold(
    key: str, heading: object, body: object, *, opens: str, open_: bool, hint: str = ""
) -> Markup:
    """Give a section with a heading that unfolds it; folded, its body is not even there."""
    head = fill(
        '<summary class="ws-fold" data-do="{opens}" data-value="{key}"{hint}>'
        "<h3>{heading}</h3></summary>",
        opens=opens, key=key, hint=attributes(title=hint or None), heading=heading,
    )  # fmt: skip
    inner = tag("div", body, class_="ws-body") if open_ else EMPTY
    return tag("details", head + inner, data_key=key, class_="ws-section", open=open_)


def menu(heading: object, body: object, *, key: str, kind: str = "", hint: str = "",
         label: str = "") -> Markup:  # fmt: skip
    """Give a menu that opens over what is around it; `kind` "up" opens it upwards."""
    return fill(
        '<details class="ws-pop {kind}" data-key="menu-{key}"{title}><summary{label}>{words}'
        '</summary><div class="ws-sheet">{body}</div></details>',
        kind=kind, key=key, title=attributes(title=hint or None), words=heading, body=body,
        label=attributes(aria_label=label or None),
    )  # fmt: skip


def rows(pairs: Iterable[tuple[object, object]], kind: str = "ws-rows") -> Markup:
    """Give a table of words and what belongs to them, numbers at the right."""
    body = join(fill("<tr><th>{head}</th><td>{value}</td></tr>", head=h, value=v) for h, v in pairs)
    return tag("table", body, class_=kind)
