"""The report as one HTML file."""

import re
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpspace.outputs.report.blocks import Picture, Report

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""What the browser may load: what is in the file, and nothing else."""

_PATH = re.compile(r' d="[^"]*"')
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_SAFE = " <>=:/;,'()[]{}!$*+?@&|^`~\"\\"
"""What the address of an image may hold as it is; the page's own escaping comes on top."""


def render_html(report: Report) -> str:
    """Render a report as a page that needs no network.

    Parameters
    ----------
    report : Report
        With figures as SVG.

    Returns
    -------
    str
    """
    templates = Environment(
        loader=PackageLoader("warpspace.outputs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["data_uri"] = _data_uri
    templates.filters["attribute_page"] = _attribute_page
    return templates.get_template("report.html.j2").render(report=report, policy=POLICY)


def _data_uri(picture: Picture) -> str:
    """Spell a figure as the address of an image; inside an image nothing runs."""
    text = re.sub(r"\s+", " ", picture.data.decode())
    text = _PATH.sub(lambda path: _NUMBER.sub(_rounded, path.group()), text)
    if "'" not in text:
        text = text.replace('"', "'")  # need no escape in the page
    return "data:image/svg+xml," + quote(text, safe=_SAFE)


def _rounded(number: re.Match[str]) -> str:
    """Round a coordinate of a path to a hundredth of a pixel."""
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")


def _attribute_page(page: str) -> Markup:
    """Spell a page as the value of an attribute: only these two characters would change it."""
    return Markup(page.replace("&", "&amp;").replace('"', "&quot;"))  # noqa: S704
