"""The conventions for the component errors of an axis, one module each."""
