"""Errors of a machine out of measured data: what the data say, and what they cannot tell apart."""

from warpspace.calibration.calibrate import calibrate
from warpspace.calibration.readings import Readings, read_readings
from warpspace.calibration.results import Calibration, Request

__all__ = ["Calibration", "Readings", "Request", "calibrate", "read_readings"]
