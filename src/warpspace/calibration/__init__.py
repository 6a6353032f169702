"""Errors of a machine out of measured data: what the data say, and what they cannot tell apart."""

from warpspace.calibration.calibrate import Calibrate, calibrate
from warpspace.calibration.calibration_result import Calibration
from warpspace.calibration.readings import Readings, read_readings

__all__ = ["Calibrate", "Calibration", "Readings", "calibrate", "read_readings"]
