"""Turns are served in the order of asking, one at a time."""

import threading

import pytest

from warpspace.app.viewport.turns import Turns


def test_those_who_wait_are_served_in_the_order_of_asking() -> None:
    turns, served, inside = Turns(), [], []
    asked = [threading.Event() for _ in range(8)]

    def work(number: int) -> None:
        asked[number].set()
        with turns:
            inside.append(number)
            assert len(inside) == 1
            served.append(number)
            inside.pop()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    with turns:
        for number, thread in enumerate(threads):
            thread.start()
            asked[number].wait()
            while len(turns._waiting) <= number:  # until it waits
                pass
        assert served == []
    for thread in threads:
        thread.join()
    assert served == list(range(8))
    with turns:
        served.append(8)
    assert served[-1] == 8


def test_an_error_hands_the_turn_on() -> None:
    turns = Turns()
    with pytest.raises(RuntimeError), turns:
        raise RuntimeError
    with turns:
        pass
