"""A task that ends its own process; in a module of its own, since processes import it."""

import os
import signal
from pathlib import Path


def square(number: int, marks: str, how: str) -> int:
    """Compute; the first time in the midst of 3 the process is ended."""
    if number == 3 and (how == "always" or not Path(marks, "killed").exists()):
        Path(marks, "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2
