"""The kinds of measurement a calibration takes, one module each."""
