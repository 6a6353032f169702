"""What the site adds to the Markdown pages, so that these stay as they are read on a code host.

- A page of ``commands/`` gets the options of its command, read from click.
- Links that leave the folder (``../CONVENTIONS.md``, ``../examples/slices.py``) lead to the page
  that the site has for them.
"""

import re
from pathlib import Path
from types import GenericAlias, UnionType
from typing import TYPE_CHECKING, Annotated

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PAGES = {
    "README.md#commands": "/commands/index.md",
    "examples/README.rst": "/gallery/index.rst",
    "CONVENTIONS.md": "/site/conventions.md",
    "CHANGELOG.md": "/site/changelog.md",
    "CONTRIBUTING.md": "/site/contributing.md",
    "GLOSSARY.md": "/site/glossary.md",
    "SECURITY.md": "/site/security.md",
    "README.md": "/index.md",
}
"""Pages outside this folder, and where the site shows them."""

ALIASES = (GenericAlias, UnionType, type(Annotated[int, 0]))
COMING = ("performance.md",)
"""Pages that a command writes (`make bench`): until it has, links to them are words."""
OPTIONS = """

```{{eval-rst}}
.. click:: {module}:{attribute}
   :prog: warpspace {name}{nested}
```
"""


def prepare(folder: Path) -> None:
    """Make the folders that other settings name."""
    (folder / "_build" / "extra").mkdir(parents=True, exist_ok=True)


def __getattr__(name: str) -> object:
    """Give a command by its name, since most are made from analyses and stand in no module."""
    from warpspace.cli.main import COMMANDS

    command = COMMANDS.get(name.replace("_", "-"))
    if command is None:
        raise AttributeError(name)
    return command


def options_of(name: str) -> str:
    """Give the Markdown that shows the options of a command.

    Parameters
    ----------
    name : str
        As it is typed, such as ``new-machine``.

    Returns
    -------
    str
    """
    from click import Group

    from warpspace.cli.main import COMMANDS

    command = COMMANDS[name]
    nested = "\n   :nested: full" if isinstance(command, Group) else ""
    attribute = name.replace("-", "_")
    return OPTIONS.format(name=name, module=__name__, attribute=attribute, nested=nested)


def inward(text: str, depth: int) -> str:
    """Turn links that leave docs/ into links of the site.

    Parameters
    ----------
    text : str
    depth : int
        Folders between the page and docs/.
    """
    up = re.escape("../" * (depth + 1))
    for outside, inside in PAGES.items():
        text = re.sub(rf"\]\({up}{re.escape(outside)}(#[^)]*)?\)", rf"]({inside}\1)", text)
    return re.sub(rf"\]\({up}examples/(\w+)\.py\)", r"](/gallery/\1.rst)", text)


def without_coming_pages(text: str, folder: Path) -> str:
    """Leave out the patterns of a toctree that match no page yet.

    Parameters
    ----------
    text : str
    folder : Path
        Of the page.
    """
    patterns = re.findall(r"^\.\./[\w-]+\*$", text, re.MULTILINE)
    for pattern in patterns:
        if not list(folder.glob(pattern + ".md")):
            text = text.replace(f"{pattern}\n", "")
    return text


def plain_bars(lines: list[str]) -> None:
    """Escape the bars of |E|, which would be a substitution in reStructuredText."""
    for i, line in enumerate(lines):
        if "``" not in line and "::" not in line:
            lines[i] = re.sub(r"(?<!\\)\|", r"\|", line)


def _short_titles() -> str:
    """Name every command in a table of contents by its name alone."""
    from warpspace.cli.main import COMMANDS

    return "\n".join(f"{name} <{name}>" for name in sorted(COMMANDS))


def _source_read(app: "Sphinx", name: str, source: list[str]) -> None:
    """Add to a page what only the site has."""
    source[0] = inward(source[0], name.count("/"))
    for page in COMING:
        if not Path(app.srcdir, page).exists():
            source[0] = re.sub(rf"\[([^\]]+)\]\([./]*{re.escape(page)}[^)]*\)", r"\1", source[0])
    source[0] = without_coming_pages(source[0], Path(app.srcdir, name).parent)
    folder, _, page = name.rpartition("/")
    if folder == "commands" and page == "index":
        source[0] = re.sub(r"^\*$", _short_titles(), source[0], flags=re.MULTILINE)
    elif folder == "commands":
        source[0] += options_of(page)


def _is_skipped(
    _: "Sphinx", __: str, ___: str, thing: object, skip: bool | None, ____: object
) -> bool | None:
    """Leave out type aliases, whose signature numpydoc cannot read."""
    return True if isinstance(thing, ALIASES) else skip


def setup(app: "Sphinx") -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("source-read", _source_read)
    app.connect("autodoc-skip-member", _is_skipped)
    app.connect("autodoc-process-docstring", lambda *given: plain_bars(given[-1]))
    app.connect("sphinx-click-process-description", lambda *given: plain_bars(given[-1]))
    app.connect("sphinx-click-process-options", lambda *given: plain_bars(given[-1]))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
