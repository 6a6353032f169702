"""The test bench: standard tests of machine tools, run on the model and evaluated on data."""
