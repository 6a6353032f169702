"""Calibration: machine errors estimated from measured data, and which of them are confounded."""

from warpspace.calibration.calibrate import Calibrate, calibrate
from warpspace.calibration.calibration_result import Calibration
from warpspace.calibration.readings import Readings
from warpspace.calibration.registry import read_readings

__all__ = ["Calibrate", "Calibration", "Readings", "calibrate", "read_readings"]
