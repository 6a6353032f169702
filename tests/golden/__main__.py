"""Keep the outputs of the commands anew: ``make golden``; read the difference before it is kept."""

import sys
import tempfile
from pathlib import Path

from golden.cases import CASES
from golden.running import (
    INPUTS,
    KEPT,
    READ,
    REFUSALS,
    keep_inputs,
    refusals,
    run_case,
    run_refused,
)

wanted = sys.argv[1:] or [*CASES, "refusals"]
KEPT.mkdir(exist_ok=True)
if "refusals" in wanted:
    with tempfile.TemporaryDirectory() as folder:
        said = [f"$ {line}\n{run_refused(line, Path(folder))[2]}\n" for line in refusals()]
    REFUSALS.write_text("".join(said), encoding="utf-8")
    for path in (*INPUTS.glob("*.txt"), *READ.glob("*.txt")):
        keep_inputs(path)
for name in wanted:
    if name == "refusals":
        continue
    with tempfile.TemporaryDirectory() as folder:
        (KEPT / f"{name}.txt").write_text(run_case(name, Path(folder)), encoding="utf-8")
for path in KEPT.glob("*.txt"):
    if path.stem not in CASES:
        path.unlink()
