"""The design review of one scene or two: a summary page, followed by the evidence."""

from warpspace.outputs.report.review import ReportSettings
from warpspace.outputs.report.sections import Embed, build_report, write_report

__all__ = ["Embed", "ReportSettings", "build_report", "write_report"]
