"""The one place where errors become messages, and shell completion."""

import os
import subprocess
import sys

import pytest

from warpspace.cli.main import cli
from warpspace.exceptions import SceneError


@pytest.mark.parametrize(
    ("failure", "status", "message"),
    [
        (SceneError("a.toml", ["title = 5: expected a text"]), 2, "a.toml: title = 5"),
        (MemoryError(), 2, "not enough memory"),
        (OSError(28, "No space left on device", "out.csv"), 2, "out.csv: No space left"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_foreseen_failure_is_one_message_and_a_status(
    failure: BaseException, status: int, message: str, monkeypatch: pytest.MonkeyPatch, warpspace
) -> None:
    def fail(**options: object) -> None:
        raise failure

    monkeypatch.setattr(cli, "main", fail)
    result = warpspace("check", "dvf5000_first")
    assert (result.status, result.out) == (status, "")
    assert message in result.err
    assert result.err.count("\n") == 1


def test_unforeseen_failure_is_not_hidden(monkeypatch: pytest.MonkeyPatch, warpspace) -> None:
    def fail(**options: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(cli, "main", fail)
    with pytest.raises(ZeroDivisionError):
        warpspace("check", "dvf5000_first")


@pytest.mark.parametrize(
    ("word", "expected"), [("dvf5000_f", ["plain,dvf5000_first"]), ("./x", ["file,./x"])]
)
def test_shell_completes_bundled_names_and_files(word: str, expected: list[str]) -> None:
    environment = {
        **os.environ,
        "COMP_WORDS": f"warpspace field {word}",
        "COMP_CWORD": "2",
        "_WARPSPACE_COMPLETE": "bash_complete",
    }
    code = "import sys; sys.argv = ['warpspace']; from warpspace.cli import main; main()"
    result = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert (result.stdout.split(), result.stderr) == (expected, "")
