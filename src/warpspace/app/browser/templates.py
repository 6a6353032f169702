"""HTML of the panels: macros of Jinja templates, one file a panel.

`Templates("design").limit(value=...)` renders the macro `limit` of `templates/design.html.j2`.
A macro knows the elements of `html.py` (`button`, `field`, `section` ...) and the actions as `do`.
Every text that is not `Markup` is escaped, also what a macro receives; an unknown name is an error.
"""

from collections.abc import Callable
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from warpspace.app.browser import actions, html


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("warpspace.app"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= vars(html) | {"do": actions}
    return environment


class Templates:
    """The macros of one file, as functions that return `Markup`."""

    def __init__(self, name: str) -> None:
        self._name = f"{name}.html.j2"
        self._template: Template | None = None

    def __getattr__(self, macro: str) -> Callable[..., Markup]:
        # compiled at first use: a page without the panel does not wait for it
        self._template = self._template or _environment().get_template(self._name)
        return getattr(self._template.module, macro)
