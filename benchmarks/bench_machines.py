"""Time to open pages of the library's machines, relative to the scene shown by default.

Every machine is opened in turns with the default scene in one Chromium, so that other load meets
both. A page counts as open when all of it is there: box, bodies, every tab.

    python benchmarks/bench_machines.py [MACHINE ...] [--pairs 3] [--json]
"""

import argparse
import json
import statistics
import sys
from contextlib import ExitStack

from bench_app import launch, opened_ms
from playwright.sync_api import sync_playwright

from warpspace.app.server.viewer import Viewer
from warpspace.bodies.placed import load_bodies
from warpspace.scene.library import load_scene, scene_names

DEFAULT = "dvf5000_first"
PREFIX = "machine_"
MEDIAN_LIMIT, WORST_LIMIT = 1.1, 1.3
READY = """() => window.__viserMutable?.nodeRefFromName['/box/surface']
    && document.documentElement.dataset.warpspace === 'open'"""


def measure(names: list[str], pairs: int) -> dict[str, dict[str, float]]:
    """Open pages in pairs; give times and their ratio by machine."""
    times_by_machine: dict[str, dict[str, float]] = {}
    with ExitStack() as viewers, sync_playwright() as playwright:
        default = viewers.enter_context(Viewer(load_scene(DEFAULT)))
        browser = launch(playwright)
        opened_ms(browser, default.url, READY)  # the first page of a browser is slow
        for name in names:
            scene = load_scene(f"{PREFIX}{name}")
            triangles = sum(len(body.triangles) for body in load_bodies(scene.machine))
            with Viewer(scene) as viewer:
                opened_ms(browser, viewer.url, READY)
                times = [
                    [opened_ms(browser, url, READY)[0] for url in (viewer.url, default.url)]
                    for _ in range(pairs)
                ]
            ours, bare = (statistics.median(column) for column in zip(*times, strict=True))
            ratio = statistics.median(own / other for own, other in times)
            times_by_machine[name] = {
                "triangles": triangles, "ms": ours, "default_ms": bare, "ratio": ratio,
            }  # fmt: skip
        browser.close()
    return times_by_machine


def main() -> None:
    """Measure, print, and fail where a limit is missed."""
    library = [name.removeprefix(PREFIX) for name in scene_names() if name.startswith(PREFIX)]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machines", nargs="*", metavar="MACHINE", help=", ".join(library))
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if unknown := [name for name in options.machines if name not in library]:
        parser.error(f"unknown machine {', '.join(unknown)}; expected {', '.join(library)}")
    times_by_machine = measure(options.machines or library, options.pairs)
    median = statistics.median(entry["ratio"] for entry in times_by_machine.values())
    worst = max(times_by_machine, key=lambda name: times_by_machine[name]["ratio"])
    if options.json:
        print(json.dumps({"machines": times_by_machine, "median_ratio": median}))
    else:
        for name, entry in times_by_machine.items():
            print(
                f"{name:26} {entry['triangles']:6.0f} triangles {entry['ms']:7.0f} ms beside"
                f" {entry['default_ms']:7.0f} ms  ratio {entry['ratio']:.2f}"
            )
        print(f"median ratio {median:.2f}  (at most {MEDIAN_LIMIT:g})")
        largest = times_by_machine[worst]["ratio"]
        print(f"worst ratio  {largest:.2f}  {worst} (at most {WORST_LIMIT:g})")
    if median > MEDIAN_LIMIT or times_by_machine[worst]["ratio"] > WORST_LIMIT:
        sys.exit("over the limit")


if __name__ == "__main__":
    main()
