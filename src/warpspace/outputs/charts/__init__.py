"""Charts: gain bars, histograms, polar plots. matplotlib figures without pyplot or a display."""

from warpspace.outputs.charts.calibration import calibration_chart
from warpspace.outputs.charts.circle import ballbar_chart
from warpspace.outputs.charts.gains import contributions_chart, gains_chart
from warpspace.outputs.charts.histogram import montecarlo_chart
from warpspace.outputs.charts.paper import CHART_ENDINGS, write_chart
from warpspace.outputs.charts.repair import repair_chart

__all__ = [
    "CHART_ENDINGS",
    "ballbar_chart",
    "calibration_chart",
    "contributions_chart",
    "gains_chart",
    "montecarlo_chart",
    "repair_chart",
    "write_chart",
]
