"""Machines from URDF files, the format of robot simulators."""
