"""What every command says and writes stays what it was, to the digits that count."""

import pytest

from golden import running
from golden.cases import CASES, DAILY
from golden.running import INPUTS, KEPT, READ, differences


def assert_refused(outcome, kept, folder, files):
    status, printed, message = outcome
    assert (status, printed) == (2, "")
    assert not differences(kept, message)
    assert {path.name for path in folder.iterdir()} == set(files)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in DAILY else pytest.mark.nightly) for name in CASES],
)
def test_it_says_and_writes_what_it_did(name, tmp_path):
    kept = (KEPT / f"{name}.txt").read_text("utf-8")
    lines = differences(kept, running.run_case(name, tmp_path))
    assert not lines, f"{CASES[name]}\n" + "\n".join(lines[:12])


@pytest.mark.parametrize(("line", "kept"), running.refusals().items())
def test_what_cannot_be_is_refused_with_its_message(line, kept, tmp_path):
    assert_refused(running.run_refused(line, tmp_path), kept, tmp_path, ())


def cases_of(folder):
    return pytest.mark.parametrize(
        ("command", "files", "kept"),
        [
            pytest.param(*case, id=f"{path.stem}: {name}")
            for path in sorted(folder.glob("*.txt"))
            for name, *case in running.input_cases(path)
        ],
    )


@cases_of(READ)
def test_a_file_is_read_as_it_was(command, files, kept, tmp_path):
    assert not differences(kept, running.run_read(command, files, tmp_path))


@cases_of(INPUTS)
def test_a_file_that_cannot_be_used_is_refused_with_its_message(command, files, kept, tmp_path):
    assert_refused(running.run_input(command, files, tmp_path), kept, tmp_path, files)


def test_nothing_is_kept_of_cases_that_are_gone():
    assert {path.stem for path in KEPT.glob("*.txt")} == set(CASES)


def test_a_changed_number_or_word_is_seen():
    assert not differences("a 1.2345 b\n", "a  1.2346 b\n")
    assert differences("a 1.2345 b\n", "a 1.2348 b\n")
    assert differences("mean 3 µm\n", "mean 3 mm\n")
    assert differences("one\n", "one\ntwo\n")
