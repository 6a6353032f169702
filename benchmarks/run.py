"""Run the benchmarks and write the performance table.

    python benchmarks/run.py [NAME …] [-o docs/performance.md]

Without names all are run and the page is written; with names their tables are printed, and a page
is written only where `-o` asks for one. Exit 1 where a target is missed.
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
from table import Section, section_text  # noqa: E402

BENCHMARKS = (
    "bench_field",
    "bench_model",
    "bench_peers",
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

Written by `{command}`; both numbers of a row were measured in the same run, so that the ratio is
what to compare between machines. Times are processor time unless a row says "wall", and the
shortest of several runs. An exponent is fitted to the three largest sizes: 1 is proportional.

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


def page_text(sections: list[Section], load: str, left_out: Sequence[str] = ()) -> str:
    """Spell the page, with the benchmarks that were left out."""
    missed = [row.label for section in sections for row in section.rows if not row.is_met]
    head = HEAD.format(
        command="make bench",
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
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    names = [n if n.startswith("bench_") else f"bench_{n}" for n in options.names] or BENCHMARKS
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        parser.error(f"no benchmark {unknown[0]!r}; expected {', '.join(BENCHMARKS)}")
    before = os.getloadavg()[0]
    sections = []
    for name in names:
        print(f"{name} …", file=sys.stderr, flush=True)
        sections.append(import_module(name).measure())
        print(section_text(sections[-1]), flush=True)
    output = options.output or (None if options.names else PAGE)
    if output is not None:
        load = load_words(before, os.getloadavg()[0])
        left_out = [name for name in BENCHMARKS if name not in names]
        output.write_text(page_text(sections, load, left_out), encoding="utf-8")
    missed = [row.label for section in sections for row in section.rows if not row.is_met]
    if missed:
        sys.exit(f"targets missed: {'; '.join(missed)}")


if __name__ == "__main__":
    main()
