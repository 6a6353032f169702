"""The report as PDF, typeset by Typst: vector figures, page numbers, tables that run over pages."""

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpspace import __version__
from warpspace.exceptions import OutputError, RenderError
from warpspace.outputs.leftovers import temporary_folder
from warpspace.outputs.report.blocks import Block, Embedded, Picture, Report
from warpspace.outputs.report.clock import report_time

TEMPLATE = "report.typ"


def render_pdf(report: Report) -> bytes:
    """Typeset a report.

    Parameters
    ----------
    report : Report
        With figures as PDF or SVG.

    Returns
    -------
    bytes
        The same for the same report and time.

    Raises
    ------
    OutputError
        If there is no room for temporary files.
    RenderError
        If it cannot be typeset.

    Notes
    -----
    All text reaches the template as data and never as markup.
    """
    import matplotlib as mpl
    import typst

    try:
        with temporary_folder() as folder:
            template = files("warpspace.outputs.report") / "templates" / TEMPLATE
            (folder / TEMPLATE).write_bytes(template.read_bytes())
            text = json.dumps(_data(report, folder), ensure_ascii=False, allow_nan=False)
            (folder / "report.json").write_text(text, encoding="utf-8")
            return typst.compile(
                str(folder / TEMPLATE),
                root=str(folder),
                font_paths=[str(Path(mpl.get_data_path()) / "fonts" / "ttf")],
                ignore_system_fonts=True,
                timestamp=int(report_time().timestamp()),
            )
    except OSError as error:
        raise OutputError(f"temporary files of the report: {error.strerror or error}") from error
    except typst.TypstError as error:
        raise RenderError(f"the report cannot be typeset: {error}") from error


def _data(report: Report, folder: Path) -> dict[str, Any]:
    """Give the report as data; figures become files beside it, interactive views are left out."""
    sections: list[dict[str, Any]] = []
    for section in report.sections:
        blocks = [
            _block(block, folder) for block in section.blocks if not isinstance(block, Embedded)
        ]
        sections.append({"heading": section.heading, "blocks": blocks})
    return {
        "title": report.title,
        "overline": report.overline,
        "facts": list(report.facts),
        "made": f"{report_time():%Y-%m-%d} · warpspace {__version__}",
        "sections": sections,
    }


def _block(block: Block, folder: Path) -> dict[str, Any]:
    """Give one block as data."""
    if not isinstance(block, Picture):
        return asdict(block)
    number = len(list(folder.iterdir()))
    path = folder / f"figure{number}.{block.form}"
    path.write_bytes(block.data)
    return {
        "kind": block.kind,
        "caption": block.caption,
        "width": block.width,
        "file": path.name,
    }
