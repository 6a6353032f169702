"""Messages carry what was asked for and what there is."""

import pytest

from warpspace.exceptions import (
    SHOWN_PROBLEMS,
    ChainError,
    OptionError,
    OutputError,
    RenderError,
    SceneError,
    UnknownNameError,
    WarpspaceError,
    near_miss,
)


@pytest.mark.parametrize(
    "kind", [ChainError, OptionError, OutputError, RenderError, SceneError, UnknownNameError]
)
def test_every_exception_is_a_warpspace_error(kind: type[Exception]) -> None:
    assert issubclass(kind, WarpspaceError)


def test_near_miss_ignores_case_and_names_two_at_most() -> None:
    assert near_miss("eay", ["EAX", "EAY"]) == ": did you mean 'EAY' or 'EAX'?"
    assert near_miss("EA", ["EAX", "EAY", "EAZ"]).count(" or ") == 1


def test_without_a_near_one_a_short_list_is_given_and_a_long_one_is_not() -> None:
    assert near_miss("?", ["one", "two"]) == "; expected one of one, two"
    assert near_miss("?", [f"name{number}" for number in range(25)]) == ""
    assert near_miss("?", []) == ""


def test_unknown_name_carries_the_name_and_the_known_ones() -> None:
    error = UnknownNameError("axis", "Q", ["X", "Y"])
    assert (error.name, error.known) == ("Q", ("X", "Y"))
    assert str(error) == "unknown axis 'Q'; expected one of X, Y"


def test_one_problem_is_one_line_and_several_are_a_list() -> None:
    assert str(SceneError("a.toml", ["title = 5: expected a text"])).count("\n") == 0
    error = SceneError("a.toml", ["one", "two"])
    assert str(error) == "a.toml: 2 problems\n  - one\n  - two"
    assert error.problems == ("one", "two")


def test_long_list_of_problems_is_cut_and_counted() -> None:
    problems = [f"problem {number}" for number in range(SHOWN_PROBLEMS + 3)]
    error = SceneError("a.toml", problems)
    assert str(error).endswith("\n  … and 3 more")
    assert str(error).count("\n") == SHOWN_PROBLEMS + 1
    assert len(error.problems) == len(problems)
