"""What of the page is open. It is no part of the picture: neither linked, undone nor compared."""

from dataclasses import dataclass

from warpspace.app.state.leaf import described, error_names

TASKS = {
    "understand": "Understand",
    "measure": "Measure",
    "improve": "Improve",
    "design": "Design",
    "machine": "Machine",
}
LONGEST_QUERY = 80


@dataclass(frozen=True, slots=True)
class PageLook:
    """What of the page is open."""

    task: str = described("understand", "Task", choices=TASKS, linked="")
    open: frozenset[str] = described(
        frozenset({"worst", "compensate", "repair", "concepts", "allocate"}),
        "Open sections",
        linked="",
    )
    # error whose row is unfolded: chosen, or the one moved last; empty for none yet
    row: str = described(
        "", "Unfolded error", choices=lambda state: {"": "none", **error_names(state)}, linked=""
    )
    query: str = described("", "Search of errors", longest=LONGEST_QUERY, linked="")
    window: str = described("", "Open window", longest=LONGEST_QUERY, linked="")
