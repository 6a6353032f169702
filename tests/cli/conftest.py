"""Run the command line in process, as the installed command does."""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from warpspace.cli import main

Command = Callable[..., "Result"]


@dataclass(frozen=True)
class Result:
    status: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)

    def refused(self, *fragments: str) -> None:
        """Check for exit 2 with one message that has all fragments, and nothing on stdout."""
        assert self.status == 2, (self.status, self.out, self.err)
        assert self.out == ""
        assert "Traceback" not in self.err
        assert self.err.count("warpspace: ") + self.err.count("Error: ") == 1, self.err
        assert len(self.err) < 6000
        for fragment in fragments:
            assert fragment in self.err, (fragment, self.err)


@pytest.fixture
def warpspace(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:

    def run(*arguments: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["warpspace", *map(str, arguments)])
        capsys.readouterr()
        try:
            main()
            status = 0
        except SystemExit as stop:
            status = int(stop.code or 0)
        out, err = capsys.readouterr()
        return Result(status, out, err)

    return run
