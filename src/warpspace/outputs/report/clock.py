"""When a report is made."""

import os
from datetime import UTC, datetime


def report_time() -> datetime:
    """Give the time of a report, UTC; ``SOURCE_DATE_EPOCH`` fixes it, so that files repeat."""
    fixed = os.environ.get("SOURCE_DATE_EPOCH", "")
    if fixed.isascii() and fixed.isdigit() and len(fixed) < 12:
        return datetime.fromtimestamp(int(fixed), UTC)
    return datetime.now(UTC)
