"""What a page is told of errors, and which of them pass by themselves."""

from collections import deque

import pytest

from warpspace.app.browser.page import is_passing


def test_the_race_inside_viser_passes_and_nothing_else_does() -> None:
    waiting = deque([1, 2])
    with pytest.raises(RuntimeError) as caught:
        waiting.extend(number for number in waiting)
    assert is_passing(caught.value)
    assert not is_passing(RuntimeError("Cannot assign to 'label' on a removed handle"))
    assert not is_passing(ValueError("mutated during iteration"))
