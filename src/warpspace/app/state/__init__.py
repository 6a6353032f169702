"""The state of a tab as frozen values; every change of it is a pure function."""
