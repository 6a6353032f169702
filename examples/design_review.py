"""
Design review
=============

Write the design review of two measured machines as a PDF.

Run: python examples/design_review.py [FOLDER]
"""

import sys
from pathlib import Path

import warpspace
from warpspace.outputs.report import ReportSettings, write_report


def main(folder: Path = Path()) -> None:
    """Write the report into a folder."""
    scenes = [warpspace.load_scene(name) for name in ("dvf5000_first", "dvf5000_second")]
    settings = ReportSettings(spec_um=50.0, samples=20_000)
    report = write_report(scenes, folder / "review.pdf", settings)
    print(f"{report.title}: {len(report.sections)} sections, {len(report.pictures)} figures")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
