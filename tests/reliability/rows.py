"""The rows of docs/reliability.md, in their order."""

from functools import partial

from reliability import doors, kills, messages, pages, proxy, soak, surroundings
from reliability.reading import read_many
from reliability.row import Outcome, Row

SEED = 14


def _read(way: str, count: int) -> Outcome:
    """Read changed files."""
    return read_many(way, count, SEED)


HOLDS = "no traceback, no more than 1 s, no more than 500 MB"
ROWS: tuple[Row, ...] = (
    Row(
        "files", f"Files of every format with bytes, numbers and words changed: {HOLDS}",
        100_000, "files", partial(_read, "bytes"),
    ),
    Row(
        "scenes", f"Whole scenes of hypothesis's making, three quarters of them changed: {HOLDS}",
        50_000, "scenes", partial(_read, "hypothesis"),
    ),
    Row(
        "coverage", f"Files that a coverage-guided fuzzer (atheris) chooses: {HOLDS}",
        50_000, "files", partial(_read, "atheris"),
    ),
    Row(
        "messages", "Hostile messages (malformed, cut, oversized, unknown handles, floods, clients"
        " that read nothing): an honest tab is answered within 1 s of an idle machine, memory and"
        " log stay",
        100_000, "messages", messages.run,
    ),
    Row(
        "kills", "Writers killed at any moment: the old file or the new one, no litter after the"
        " next run", 1_000, "kills", kills.run,
    ),
    Row(
        "surroundings", "Full disk, read-only and no home, deleted folder, languages, names, two"
        " instances at once: done, or one message and nothing half-written",
        160, "runs", surroundings.run,
    ),
    Row(
        "soak", "Twenty tabs that come, drag, drop out and come back: nothing grows",
        60, "minutes", soak.run,
    ),
    Row(
        "doors", "Foreign hosts and origins, tokens guessed and replayed, links and uploads built"
        " to exhaust, from raw clients: none let in, an answer within 1 s of an idle machine",
        20_000, "attempts", doors.run,
    ),
    Row(
        "pages", "A foreign page in a real browser tries to get in: none does",
        800, "attempts", pages.run,
    ),
    Row(
        "proxy", "Visitors through a real nginx with TLS and two servers, each thrice; the doors"
        " through it; a server lost: each visitor stays at one server, nobody else gets in",
        200, "visitors", proxy.run,
    ),
)  # fmt: skip
