"""Exports and reports: how long they take and how large they get, beside what the issue allows.

Run: python benchmarks/bench_outputs.py
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

LIMITS = (  # name, arguments, seconds allowed, bytes allowed
    ("export .glb", ("export", "dvf5000_first"), "glb", None, None),
    ("export .vts", ("export", "dvf5000_first"), "vts", None, None),
    ("export .csv", ("export", "dvf5000_first"), "csv", None, None),
    ("export .html", ("export", "dvf5000_first"), "html", None, 3_000_000),
    ("report .html, one scene", ("report", "dvf5000_first"), "html", 30.0, 8_000_000),
    ("report .html, two scenes", ("report", "dvf5000_first", "dvf5000_second"), "html", 30.0, 8e6),
    ("report .pdf, two scenes", ("report", "dvf5000_first", "dvf5000_second"), "pdf", 30.0, 8e6),
    (
        "animate .webp, 12 pictures",
        ("animate", "dvf5000_first", "--frames", "12"),
        "webp",
        None,
        None,
    ),
)


def main() -> int:
    """Run every command as a user does; exit 1 where a limit is broken."""
    broken = 0
    floor = _timed(["-c", "import warpspace, numpy"])
    print(f"{'':30} {'seconds':>9} {'allowed':>9} {'MB':>8} {'allowed':>9}")
    print(f"{'floor: python, numpy':30} {floor:9.2f}")
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, arguments, ending, seconds, size) in enumerate(LIMITS):
            target = Path(folder) / f"{number}.{ending}"
            took = _timed(["-m", "warpspace", *arguments, "-o", str(target)])
            large = target.stat().st_size
            late = seconds is not None and took > seconds
            fat = size is not None and large > size
            broken += late + fat
            print(
                f"{name:30} {took:9.2f} {'' if seconds is None else f'{seconds:.0f}':>9}"
                f" {large / 1e6:8.2f} {'' if size is None else f'{size / 1e6:.0f}':>9}"
                + (" TOO SLOW" if late else "")
                + (" TOO LARGE" if fat else "")
            )
    return 1 if broken else 0


def _timed(arguments: list[str]) -> float:
    """Wall time of a Python process, s."""
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(main())
