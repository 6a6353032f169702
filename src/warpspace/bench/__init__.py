"""The test bench: standard tests of machine tools, run on the model and evaluated on data.

A test gives a plan (path, set-up, what is sensed); `readings` evaluates the model along it, exactly
or as a linear function of the errors; the test evaluates readings by its standard's formulas,
whoever took them, and lays out its figure. Tests are registered in `registry`, one file each in
`kinds`.
"""
