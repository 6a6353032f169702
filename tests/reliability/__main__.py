"""Run rows of docs/reliability.md and write down what came of them: `make reliability`."""

import argparse
import sys
import time
from datetime import UTC, datetime

from reliability.rows import PAGE, ROWS, put_row


def main() -> int:
    """Run what is asked for; 1 where a row fails."""
    parser = argparse.ArgumentParser(prog="reliability", description=__doc__.splitlines()[0])
    parser.add_argument("--fraction", type=float, default=1.0, help="of the full counts")
    parser.add_argument("--rows", default=",".join(ROWS), help=f"of {', '.join(ROWS)}")
    parser.add_argument("--dry", action="store_true", help="leave the page as it is")
    options = parser.parse_args()
    chosen = options.rows.split(",")
    if unknown := set(chosen) - set(ROWS):
        parser.error(f"unknown rows {', '.join(sorted(unknown))}; expected {', '.join(ROWS)}")
    if not 0.0 < options.fraction <= 1.0:
        parser.error("--fraction: expected above 0, at most 1")
    failed = False
    for name in (name for name in ROWS if name in chosen):
        began = time.monotonic()
        outcome = ROWS[name].run(max(1, round(ROWS[name].full * options.fraction)))
        failed |= bool(outcome.faults)
        seconds = time.monotonic() - began
        print(f"{name}: {outcome.count:,}, {seconds:.0f} s; {outcome.result}", flush=True)
        for fault in outcome.faults:
            print(f"  fault: {fault}", flush=True)
        if not options.dry and outcome.count:
            date = datetime.now(UTC).date().isoformat()
            PAGE.write_text(put_row(PAGE.read_text("utf-8"), name, outcome, date), "utf-8")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
