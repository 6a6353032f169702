"""Start-up time of the package and the command line."""

from table import Row, Section
from timing import cheapest, commands_in_turns, python

REPEATS = 7


def measure() -> Section:
    """Measure fresh interpreters."""
    bare = cheapest(lambda: python("-c", "pass"), REPEATS).processor_s
    package = cheapest(lambda: python("-c", "import warpspace"), REPEATS).processor_s
    help_s = cheapest(lambda: python("-m", "warpspace", "-h"), REPEATS).processor_s
    command = ("-m", "warpspace", "field", "dvf5000_first", "--at", "X=0")
    point, numpy = commands_in_turns(command, ("-c", "import numpy"), REPEATS)
    baseline = "python -c pass"
    rows = [
        Row("import warpspace, Python included", package, baseline, bare),
        Row("import warpspace alone", max(package - bare, 0.0), baseline, bare, max_value=0.06),
        Row("warpspace -h", help_s, baseline, bare, max_value=0.3),
        Row(
            "warpspace field SCENE --at X=0",
            point.processor_s,
            "python -c 'import numpy'",
            numpy.processor_s,
            max_ratio=2.0,
        ),
    ]
    text = "Whole processes. What an import loads is what it costs; a test says what that is."
    return Section("Start", text, rows)
