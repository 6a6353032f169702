"""The test bench: standard tests of machine tools, run on the model and evaluated on data.

A test gives a plan (path, set-up, what is sensed); the model is evaluated along it, exactly or as a
linear function of the errors; the test evaluates readings by its standard's formulas, whoever took
them, and lays out its figure. Tests are registered in `base`; they stand in `kinds`.
"""
