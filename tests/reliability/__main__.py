"""Run rows of docs/reliability.md and write down what came of them: `make reliability`.

    python -m reliability [--fraction 0.01] [--rows files,kills] [--dry]

The whole takes some hours. The page says how often each row was really tried.
"""

import argparse
import sys
import time
from datetime import UTC, datetime

from reliability.rows import ROWS
from reliability.table import PAGE, put_rows, spell_row


def main() -> int:
    """Run what is asked for; 1 where a row fails."""
    names = tuple(row.name for row in ROWS)
    parser = argparse.ArgumentParser(prog="reliability", description=__doc__.splitlines()[0])
    parser.add_argument("--fraction", type=float, default=1.0, help="of the full counts")
    parser.add_argument("--rows", default=",".join(names), help=f"of {', '.join(names)}")
    parser.add_argument("--dry", action="store_true", help="leave the page as it is")
    options = parser.parse_args()
    chosen = options.rows.split(",")
    if unknown := set(chosen) - set(names):
        parser.error(f"unknown rows {', '.join(sorted(unknown))}; expected {', '.join(names)}")
    if not 0.0 < options.fraction <= 1.0:
        parser.error("--fraction: expected above 0, at most 1")
    failed = False
    for row in ROWS:
        if row.name not in chosen:
            continue
        began = time.monotonic()
        outcome = row.run(max(1, round(row.full * options.fraction)))
        failed |= bool(outcome.faults)
        line = spell_row(row, outcome, datetime.now(UTC).date().isoformat())
        print(f"{line}\n  {time.monotonic() - began:.0f} s", flush=True)
        for fault in outcome.faults:
            print(f"  fault: {fault}", flush=True)
        if not options.dry and outcome.count:
            text = PAGE.read_text("utf-8")
            PAGE.write_text(put_rows(text, {row.name: line}, names), "utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
