"""Compensation tables for controllers, and the residual error after compensation."""
