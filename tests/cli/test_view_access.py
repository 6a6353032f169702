"""Options of `view` that say who may use the app."""

import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import contextmanager
from typing import Any

from warpspace.app.server import viewer
from warpspace.app.server.request_policy import Access


def test_options_reach_the_app(warpspace, monkeypatch):
    given: list[dict[str, Any]] = []
    monkeypatch.setattr(viewer, "run_viewer", lambda *_, **words: given.append(words))
    hosts = ("--allow-host", "a.example", "--allow-host", "b.example:1")
    assert warpspace("view", *hosts, "--token", "x" * 12).status == 0
    assert warpspace("view", "--host", "0.0.0.0", "--no-token").status == 0
    assert given[0]["access"] == Access(("a.example", "b.example:1"), "x" * 12)
    assert given[1]["access"] == Access(no_token=True)
    assert not given[0]["code"]  # nobody scans what goes into a file


@contextmanager
def app(*words):
    """Run the command; it ends by SIGTERM, as tests run in the background ignore Ctrl-C."""
    command = [sys.executable, "-m", "warpspace", "view", "teach_tilted_c", "--no-browser", *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.wait(20)


def status(link):
    try:
        with urllib.request.urlopen(link, timeout=20) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_beyond_this_machine_the_printed_link_carries_a_token():
    with app("--host", "0.0.0.0") as process:
        first, second = (process.stdout.readline() for _ in range(2))
        link = first.partition(" is shown at ")[2].split()[0]
        assert "/?token=" in link
        assert second.startswith("from other machines: http://")
        assert second.strip().endswith(link.partition("/?")[2])
        assert status(link) == status(second.split()[-1]) == 200
        assert status(link.partition("?")[0]) == status(link + "x") == 403


def test_without_a_token_the_command_says_what_it_means():
    with app("--host", "0.0.0.0", "--no-token") as process:
        link = process.stdout.readline().partition(" is shown at ")[2].split()[0]
        assert "token" not in link
        assert status(link) == 200
        said = process.stderr.readline()
        assert "WARNING" in said
        assert "anyone who reaches it" in said
