"""Memory of closed tabs: given back once for all that close together, and not after the end."""

import gc
import threading
import time
import weakref
from collections.abc import Iterator

import pytest

from warpspace.app.server import memory
from warpspace.app.server.memory import Tidier, give_back_memory, limit_arenas, settle_memory

WAIT_S = 0.05


class Ring:
    """Holds itself, as the handles of a closed tab hold each other."""

    def __init__(self) -> None:
        self.me = self


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> threading.Semaphore:
    """Count how often memory is given back instead of doing it."""
    times = threading.Semaphore(0)
    monkeypatch.setattr(memory, "give_back_memory", times.release)
    return times


@pytest.fixture
def thawed() -> Iterator[None]:
    """Have the collector look at everything again afterwards."""
    yield
    gc.unfreeze()


def test_what_only_holds_itself_is_freed() -> None:
    ring = Ring()
    gone = weakref.ref(ring)
    del ring
    give_back_memory()
    assert gone() is None


@pytest.mark.usefixtures("thawed")
def test_what_was_there_before_serving_is_left_out_of_searches() -> None:
    limit_arenas()
    settle_memory()
    assert gc.get_freeze_count() > 1000


def test_tabs_that_close_together_share_one_tidying(given: threading.Semaphore) -> None:
    tidier = Tidier(WAIT_S)
    for _ in range(5):
        tidier.soon()
    assert given.acquire(timeout=5)
    assert not given.acquire(timeout=4 * WAIT_S)


def test_a_tab_that_closes_later_is_tidied_up_after_too(given: threading.Semaphore) -> None:
    tidier = Tidier(WAIT_S)
    for _ in range(2):
        tidier.soon()
        assert given.acquire(timeout=5)


def test_nothing_is_done_after_the_end(given: threading.Semaphore) -> None:
    tidier = Tidier(WAIT_S)
    tidier.soon()
    tidier.stop()
    tidier.soon()
    assert not given.acquire(timeout=4 * WAIT_S)


def test_asking_does_not_wait(given: threading.Semaphore) -> None:
    tidier, start = Tidier(60.0), time.monotonic()
    tidier.soon()
    assert time.monotonic() - start < 1.0
    assert not given.acquire(blocking=False)
    tidier.stop()
