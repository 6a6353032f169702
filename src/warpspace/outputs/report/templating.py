"""A report as one HTML file, and as PDF typeset by Typst: vector figures, tables over pages."""

import json
import os
import re
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from warpspace.analysis.blocks import Table, table_html
from warpspace.exceptions import OutputError, RenderError
from warpspace.outputs.file_output import temporary_folder
from warpspace.resources import __version__

TEMPLATE = "report.typ"
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:;"
    " style-src 'unsafe-inline'; img-src data: blob:; font-src data: blob:;"
    " connect-src data: blob:; worker-src blob: data:; frame-src 'self'"
)
"""Content policy: the browser loads only what is in the file."""

_PATH = re.compile(r' d="[^"]*"')
_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_UNSAFE = re.compile(r"[%#]|[^\x20-\x7e]+")
"""Characters to encode in the address of an image; the page escapes it in addition."""


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; `role` is "lead" for the verdict, "heading", "body", "note", or "code"."""

    text: str
    role: str = "body"


@dataclass(frozen=True, slots=True)
class Cards:
    """Key numbers side by side: label, value with unit, remark."""

    cards: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True, slots=True)
class ReportFigure:
    """A figure as the bytes of an SVG or PDF file, with its caption."""

    name: str
    caption: str
    data: bytes
    form: str
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class Embedded:
    """A page inside the page, for instance a 3-D view; omitted in print."""

    title: str
    html: str


@dataclass(frozen=True, slots=True)
class Items:
    """A list of remarks."""

    items: tuple[str, ...]


Block = Text | Cards | Table | ReportFigure | Embedded | Items


@dataclass(frozen=True, slots=True)
class ReportSection:
    """A part of the report with a heading; the first is the first page."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report."""

    title: str
    overline: str  # kind of document
    facts: tuple[str, ...]  # machine, date, version: one line below the title
    sections: tuple[ReportSection, ...]
    missing: tuple[str, ...] = ()  # figures that could not be drawn, with the reason

    @property
    def pictures(self) -> tuple[ReportFigure, ...]:
        return tuple(
            b for part in self.sections for b in part.blocks if isinstance(b, ReportFigure)
        )


def report_time() -> datetime:
    """Return the time of a report, UTC; ``SOURCE_DATE_EPOCH`` fixes it for reproducible files."""
    fixed = os.environ.get("SOURCE_DATE_EPOCH", "")
    if fixed.isascii() and fixed.isdigit() and len(fixed) < 12:
        return datetime.fromtimestamp(int(fixed), UTC)
    return datetime.now(UTC)


def _kind(block: Block) -> str:
    return type(block).__name__.lower()


def render_html(report: Report) -> str:
    templates = Environment(
        loader=PackageLoader("warpspace.outputs.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters |= {
        "kind": _kind,
        "data_uri": _data_uri,
        "attribute_page": _attribute_page,
        "table": _table_markup,
    }
    return templates.get_template("report.html.j2").render(report=report, policy=POLICY)


def _table_markup(table: Table) -> Markup:
    return Markup(table_html(table))  # noqa: S704 - escaped there


def _data_uri(picture: ReportFigure) -> str:
    text = re.sub(r"\s+", " ", picture.data.decode())
    text = _PATH.sub(lambda path: _NUMBER.sub(_rounded, path.group()), text)
    if "'" not in text:
        text = text.replace('"', "'")  # need no escape in the page
    return "data:image/svg+xml," + _UNSAFE.sub(lambda found: quote(found.group()), text)


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")


def _attribute_page(page: str) -> Markup:
    """Escape a page as the value of an attribute: only these two characters would change it."""
    return Markup(page.replace("&", "&amp;").replace('"', "&quot;"))  # noqa: S704


def render_pdf(report: Report) -> bytes:
    import typst
    from matplotlib import get_data_path

    try:
        with temporary_folder() as folder:
            template = files("warpspace.outputs.report") / "templates" / TEMPLATE
            (folder / TEMPLATE).write_bytes(template.read_bytes())
            sections: list[dict[str, Any]] = []
            for part in report.sections:
                printed = (block for block in part.blocks if not isinstance(block, Embedded))
                blocks = [_as_data(block, folder) for block in printed]
                sections.append({"heading": part.heading, "blocks": blocks})
            data = {
                "title": report.title,
                "overline": report.overline,
                "facts": report.facts,
                "made": f"{report_time():%Y-%m-%d} · warpspace {__version__}",
                "sections": sections,
            }
            text = json.dumps(data, ensure_ascii=False, allow_nan=False)
            (folder / "report.json").write_text(text, encoding="utf-8")
            return typst.compile(
                str(folder / TEMPLATE),
                root=str(folder),
                font_paths=[str(Path(get_data_path()) / "fonts" / "ttf")],
                ignore_system_fonts=True,
                timestamp=int(report_time().timestamp()),
            )
    except OSError as error:
        raise OutputError(f"temporary files of the report: {error.strerror or error}") from error
    except typst.TypstError as error:
        raise RenderError(f"the report cannot be typeset: {error}") from error


def _as_data(block: Block, folder: Path) -> dict[str, Any]:
    if isinstance(block, ReportFigure):
        path = folder / f"figure{len(list(folder.iterdir()))}.{block.form}"
        path.write_bytes(block.data)
        fields = {"caption": block.caption, "width": block.width, "file": path.name}
    elif isinstance(block, Table):
        fields = _table(block)
    else:
        fields = asdict(block)
    return {"kind": _kind(block), **fields}


def _table(block: Table) -> dict[str, Any]:
    heads = [column.head.replace("\n", " ") for column in block.visible_columns]
    rows = block.cells()
    longest = [max(map(len, cells)) for cells in zip(heads, *rows, strict=True)]
    longest_words = [max(map(len, head.split()), default=0) for head in heads]
    return {
        "caption": block.title,
        "heads": heads,
        "numbers": [column.is_number for column in block.visible_columns],
        # shares of the page: as wide as its cells, within reason
        "widths": [
            min(max(cells if cells < 16 else 16 + 0.4 * (cells - 16), word), 32) + 2
            for cells, word in zip(longest, longest_words, strict=True)
        ],
        "rows": rows,
        "marks": block.marks,
    }
