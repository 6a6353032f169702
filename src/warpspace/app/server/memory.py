"""Memory of a server that runs for weeks while tabs come and go.

Nothing is kept of a closed tab, and yet the memory of the process grew, for two reasons. viser's
handles hold each other, so that only the collector of cycles frees a tab (1.5 MB). And each tab has
a thread of its own: glibc gives threads up to eight arenas per core, from each of which it returns
only what lies behind the last piece in use, so that large passing arrays leave holes everywhere.
Therefore: few arenas, and after tabs have closed one collection and one `malloc_trim`.
"""

import ctypes
import gc
import sys
import threading

ARENAS = 2
"""Places glibc allocates from: little is allocated without holding Python's lock anyway."""
TIDY_S = 10.0
"""Time between a tab's end and the search for what it has left; others that end share it."""
_M_ARENA_MAX = -8


def limit_arenas() -> None:
    """Have threads that are started from now on share few arenas."""
    libc = _glibc()
    if libc is not None:
        libc.mallopt(_M_ARENA_MAX, ARENAS)


def settle_memory() -> None:
    """Leave what is there out of all further searches for cycles, during which all tabs wait.

    To be called while no tab is open: cycles that become garbage later would stay.
    """
    gc.collect()
    gc.freeze()


def give_back_memory() -> None:
    """Free what only holds itself, and return free pages to the system."""
    gc.collect()
    libc = _glibc()
    if libc is not None:
        libc.malloc_trim(0)


def _glibc() -> ctypes.CDLL | None:
    """Give the C library where it has the calls used here."""
    if not sys.platform.startswith("linux"):
        return None
    libc = ctypes.CDLL(None)
    return libc if hasattr(libc, "mallopt") and hasattr(libc, "malloc_trim") else None


class Tidier:
    """Gives memory back a while after it was asked to, once for all who ask meanwhile.

    Parameters
    ----------
    wait_s : float, optional
    """

    def __init__(self, wait_s: float = TIDY_S) -> None:
        self._wait_s = wait_s
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._stopped = False

    def soon(self) -> None:
        """Ask for it; returns at once."""
        with self._lock:
            if self._timer is None and not self._stopped:
                self._timer = threading.Timer(self._wait_s, self._run)
                self._timer.daemon = True
                self._timer.start()

    def stop(self) -> None:
        """Do it no more."""
        with self._lock:
            self._stopped = True
            if self._timer is not None:
                self._timer.cancel()

    def _run(self) -> None:
        """Do it; who asks from now on is served by the next time."""
        with self._lock:
            self._timer = None
        give_back_memory()
