"""The report as one HTML file."""

import base64

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpspace.outputs.report.blocks import Picture, Report

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""What the browser may load: what is in the file, and nothing else."""


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
    return "data:image/svg+xml;base64," + base64.b64encode(picture.data).decode()


def _attribute_page(page: str) -> Markup:
    """Spell a page as the value of an attribute: only these two characters would change it."""
    return Markup(page.replace("&", "&amp;").replace('"', "&quot;"))  # noqa: S704
