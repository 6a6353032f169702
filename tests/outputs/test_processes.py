"""Processes of the program's own: replaced when they die, never waited for in vain."""

import os
import sys
import threading
import time
from concurrent.futures import CancelledError

import psutil
import pytest

from lost_process import die_while_answering, refuse, sleep_after, square
from warpspace.exceptions import WorkersLostError
from warpspace.outputs.processes import ProcessPool

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")


@pytest.fixture(autouse=True)
def children():
    before = set(psutil.Process().children(recursive=True))
    yield
    left = set(psutil.Process().children(recursive=True)) - before
    assert [process for process in left if "resource_tracker" not in str(process.cmdline())] == []


def test_a_task_of_a_process_that_died_is_done_again(tmp_path):
    with ProcessPool(2, losses=1) as pool:
        futures = [pool.submit(square, number, str(tmp_path), "once") for number in range(8)]
        assert [future.result(60) for future in futures] == [number**2 for number in range(8)]
    assert (tmp_path / "killed").exists()


def test_processes_that_die_too_often_are_not_replaced(tmp_path):
    said = r"^worker processes died 3 times \(out of memory"
    with ProcessPool(1, losses=2) as pool:
        for _ in range(2):  # the second time no process is started any more
            with pytest.raises(WorkersLostError, match=said):
                pool.submit(square, 3, str(tmp_path), "always").result(60)


@pytest.mark.parametrize("size", [100, 1_000_000])
def test_half_an_answer_is_not_waited_for(size, tmp_path):
    with ProcessPool(2) as pool:
        other = pool.submit(square, 2, str(tmp_path), "never")
        with pytest.raises(WorkersLostError, match="died once"):
            pool.submit(die_while_answering, size).result(60)
        assert other.result(60) == 4


def test_killing_a_pool_does_not_wait_for_its_tasks(tmp_path):
    pool = ProcessPool(1)
    begun, waiting = (pool.submit(sleep_after, str(tmp_path / name)) for name in ("a", "b"))
    while not (tmp_path / "a").exists():
        time.sleep(0.01)
    begin = time.monotonic()
    pool.kill()
    assert time.monotonic() - begin < 30.0
    with pytest.raises(WorkersLostError, match="were ended"):
        begun.result(0)
    with pytest.raises(CancelledError):
        waiting.result(0)
    assert not (tmp_path / "b").exists()


def test_a_process_is_replaced_after_its_number_of_tasks():
    with ProcessPool(1, tasks_per_process=2) as pool:
        pids = [pool.submit(os.getpid).result(60) for _ in range(4)]
    assert pids[0] == pids[1] != pids[2] == pids[3]


def test_what_cannot_be_sent_is_an_error_and_ends_nothing(tmp_path):
    with ProcessPool(1) as pool:
        for said, *task in (
            ("pickle", square, threading.Lock(), "", ""),  # the task
            ("pickle", threading.Lock),  # what it returns
            ("missing 1 required", refuse, "x"),  # what it raises
        ):
            with pytest.raises(TypeError, match=said):
                pool.submit(*task).result(60)
        with pytest.raises(ZeroDivisionError) as caught:
            pool.submit(divmod, 1, 0).result(60)
        assert "in a worker process" in caught.value.__notes__[0]
        assert pool.submit(square, 2, str(tmp_path), "never").result(60) == 4
