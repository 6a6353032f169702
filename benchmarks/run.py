"""Run the benchmarks and write the performance table.

    python benchmarks/run.py [NAME …] [--runs 3] [-o docs/performance.md]

Without names all are run and the page is written; with names their tables are printed, and a page
is written only where `-o` asks for one. With `--runs` everything is run so many times, one complete
run after the other, and each figure is the median. Exit 1 where a target is missed.
"""

import argparse
import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import import_module, metadata
from pathlib import Path

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # as the command does; before numpy is loaded

import psutil  # noqa: E402
from table import Section, median_section, section_text  # noqa: E402

BENCHMARKS = (
    "bench_field",
    "bench_model",
    "bench_peers",
    "bench_task",
    "bench_montecarlo",
    "bench_acceptance",
    "bench_parts",
    "bench_measured",
    "bench_program",
    "bench_start",
    "bench_outputs",
    "bench_figures",
    "bench_app",
    "bench_tabs",
    "bench_playback",
)
"""One module each, with a function `measure` that gives a `Section`."""
APART = ("bench_cluster", "bench_machines")
"""Programs of their own, with pages or output of their own."""
PAGE = Path(__file__).parents[1] / "docs" / "performance.md"
PACKAGES = ("warpspace", "numpy", "scipy", "viser", "pyvista", "vtk", "pyarrow")
PEERS = ("pytransform3d", "pin")
HEAD = """# Performance

Written by `make bench`{runs}. Both numbers of a row are measured in turns: compare the ratio
between machines, not the time. Times are processor time unless a row says "wall", and the shortest
of several repetitions. An exponent is fitted to the three largest sizes: 1 is proportional.

| | |
|---|---|
| date | {date} |
| machine | {machine} |
| load while it ran | {load} |
| versions | {versions} |
| targets | {missed} |
| not run | {left_out} |
"""


def machine_words() -> str:
    """Describe the machine."""
    memory = psutil.virtual_memory().total / 2**30
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores, {memory:.0f} GB of memory, {platform.system()} on {platform.machine()}"


def version_words() -> str:
    """List what was measured with."""
    versions = [f"{name} {metadata.version(name)}" for name in (*PACKAGES, *PEERS)]
    return f"Python {platform.python_version()}, " + ", ".join(versions)


def load_words(before: float, after: float) -> str:
    """Describe the other load of the machine."""
    cores = os.cpu_count() or 1
    load_text = f"{before:.1f} before, {after:.1f} at the end (mean of a minute, {cores} cores)"
    if max(before, after) > cores:
        load_text += "; other programs were running: compare ratios, not times"
    return load_text


def page_text(
    sections: list[Section], load: str, left_out: Sequence[str] = (), runs: int = 1
) -> str:
    """Spell the page, with the benchmarks that were left out."""
    missed = [row.label for section in sections for row in section.rows if not row.is_met]
    head = HEAD.format(
        runs="" if runs == 1 else f": the medians of {runs} complete runs",
        date=datetime.now(UTC).strftime("%Y-%m-%d"),
        machine=machine_words(),
        load=load,
        versions=version_words(),
        left_out=", ".join(left_out) or "none",
        missed="all met" if not missed else f"missed: {'; '.join(missed)}",
    )
    return "\n".join([head, *(section_text(section) for section in sections)]).rstrip() + "\n"


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help=f"of {', '.join(BENCHMARKS)}")
    parser.add_argument("--runs", type=int, default=1, choices=range(1, 10), metavar="N")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    names = [n if n.startswith("bench_") else f"bench_{n}" for n in options.names] or BENCHMARKS
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"no benchmark {unknown[0]!r}; expected {', '.join(BENCHMARKS)}")
    before = os.getloadavg()[0]
    measured: dict[str, list[Section]] = {name: [] for name in names}
    for run in range(options.runs):
        for name in names:
            print(f"run {run + 1}: {name} …", file=sys.stderr, flush=True)
            measured[name].append(import_module(name).measure())
            print(section_text(measured[name][-1]), flush=True)
    sections = [median_section(runs) for runs in measured.values()]
    output = options.output or (None if options.names else PAGE)
    if output is not None:
        load = load_words(before, os.getloadavg()[0])
        left_out = [name for name in BENCHMARKS if name not in names]
        output.write_text(page_text(sections, load, left_out, options.runs), encoding="utf-8")
    missed = [row.label for section in sections for row in section.rows if not row.is_met]
    if missed:
        sys.exit(f"targets missed: {'; '.join(missed)}")


if __name__ == "__main__":
    main()
