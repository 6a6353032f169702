"""HTML of the panels: macros of Jinja templates, one file a panel.

`Templates("design").limit(value=...)` renders the macro `limit` of `templates/design.html.j2`.
A macro knows the elements of `elements.html.j2` and `html.py`, and the actions as `do`.
Every text that is not `Markup` is escaped, also what a macro receives; an unknown name is an error.
Line breaks between elements are for readers of the template only.
"""

import re
from collections.abc import Callable
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from jinja2.ext import Extension
from markupsafe import Markup

from warpspace.app.browser import actions, html


class Compact(Extension):
    """Removes line breaks between elements, which the page would show as blanks."""

    def preprocess(self, source: str, name: object, filename: object = None) -> str:  # noqa: ARG002
        return re.sub(r"(?<=[>}])\s*\n\s*(?=[<{])", "", source)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("warpspace.app"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        extensions=[Compact],
    )
    names: Any = environment.globals
    names.update(vars(html), do=actions)
    names.update(vars(environment.get_template("elements.html.j2").module))
    return environment


def compile_all() -> None:
    """Compile all templates, so that the first page does not wait for it."""
    for name in _environment().list_templates():
        _environment().get_template(name)


class Templates:
    """The macros of one file, as functions that return `Markup`."""

    def __init__(self, name: str) -> None:
        self._name = f"{name}.html.j2"
        self._template: Template | None = None

    def __getattr__(self, macro: str) -> Callable[..., Markup]:
        # compiled at first use: a page without the panel does not wait for it
        self._template = self._template or _environment().get_template(self._name)
        return getattr(self._template.module, macro)
