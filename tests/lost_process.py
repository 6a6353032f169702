"""Tasks that end their own process; in a module of their own, since processes import it."""

import os
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path


def square(number: int, marks: str, how: str) -> int:
    """Compute; the first time in the midst of 3 the process is ended."""
    if number == 3 and (how == "always" or not Path(marks, "killed").exists()):
        Path(marks, "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number**2


def die_while_answering(size: int) -> bytes:
    """Be killed when half of the answer is in the pipe."""

    def write_half(pipe: Connection, data: memoryview, *_: object) -> None:
        os.write(pipe.fileno(), bytes(data)[: max(1, len(data) // 2)])
        os.kill(os.getpid(), signal.SIGKILL)

    Connection._send = write_half
    return bytes(size)


def sleep_after(path: str) -> None:
    Path(path).touch()
    time.sleep(60.0)


def refuse(word: str) -> None:
    raise UntransferableError(word, word)


class UntransferableError(Exception):
    """Takes more than its message."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(first + second)
