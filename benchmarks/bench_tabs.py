"""Five tabs drag a slider each at 20 Hz beside fifteen idle ones: latency, stale values, memory.

Latency is from sending a slider's position until the points of that position, or of a later one,
have come back: everything but the browser.
"""

import asyncio
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from table import Growth, Row, Section
from timing import best

from warpspace import load_scene
from warpspace.app.browser import actions as do
from warpspace.app.drawing.box import packed
from warpspace.app.evaluation.live_model import DrawnScale, LiveModel
from warpspace.app.state.app_state import start_state
from warpspace.picture.map_mesh import map_mesh

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from page_client import App, Tab, running_app, said

TABS, IDLE, SECONDS, RATE = 5, 15, 15.0, 20.0
GROWING = (1, 2, 4, 8)
KEY = "EAY"
POSITIONS = 61
OPENED_S = 3.0  # until what a page computes once it has opened is done: no part of a drag
FINAL_S = 10.0
"""Time after which a last value that is not shown counts as stale."""


def expected() -> tuple[np.ndarray, dict[str, int]]:
    """Return the positions of the drag and the points that each must show."""
    values = np.linspace(-90.0, 90.0, POSITIONS).round(1)
    live, state = LiveModel(), start_state(load_scene("dvf5000_first"))
    held = DrawnScale(live.evaluate(state).exaggeration)
    pictures = [live.evaluate(state.with_amplitude(KEY, v), held) for v in values.tolist()]
    numbers = {
        packed(map_mesh(picture).vertices_mm.astype("<f4")): i for i, picture in enumerate(pictures)
    }
    assert len(numbers) == POSITIONS, "positions cannot be told apart by their points"
    return values, numbers


@dataclass(frozen=True)
class TabTimes:
    """Latencies in s, processor time of a picture in s, its bytes, stale tabs, memory in MB."""

    median_s: float
    p95_s: float
    picture_s: float
    size: float
    stale: int
    memory_mb: float


async def drag(tab: Tab, values: np.ndarray, seconds: float, rate: float) -> list[tuple]:
    """Hold the slider and drag to and fro; give when which position was sent."""
    await tab.send(said(do.Signal.HOLD))
    sent, start, tick = [], time.perf_counter(), 0
    # tabs are not in step with each other
    await asyncio.sleep(np.random.default_rng(id(tab)).uniform(0.0, 1.0 / rate))
    while time.perf_counter() - start < seconds:
        at = tick % (2 * POSITIONS - 2)
        index = at if at < POSITIONS else 2 * POSITIONS - 2 - at
        sent.append((time.perf_counter(), index))
        await tab.drag(KEY, float(values[index]))
        tick += 1
        await asyncio.sleep(max(0.0, start + tick / rate - time.perf_counter()))
    return sent


def latencies(sent: list[tuple], received: list[tuple], numbers: dict[str, int]) -> list[float]:
    """Compute the time until each position sent, or a later one, was answered, s."""
    delays, answered = [], 0
    for at, points in received:
        index = numbers.get(points)
        # the latest position sent before with these points
        newest = next(
            (
                i
                for i in range(len(sent) - 1, answered - 1, -1)
                if sent[i][0] < at and sent[i][1] == index
            ),
            None,
        )
        if newest is None:
            continue
        delays += [at - sent[i][0] for i in range(answered, newest + 1)]
        answered = newest + 1
    return delays


async def drag_all(app: App, tabs: int, idle: int) -> TabTimes:
    """Have some tabs drag beside some idle ones."""
    values, numbers = expected()
    all_tabs = [Tab(app) for _ in range(tabs + idle)]
    dragging = all_tabs[:tabs]
    for tab in all_tabs:
        await tab.open()
    await asyncio.sleep(OPENED_S)
    for tab in dragging:
        tab.seen.clear()
        tab.bytes = 0
    used = sum(app.process.cpu_times()[:2])
    sent = await asyncio.gather(*(drag(tab, values, SECONDS, RATE) for tab in dragging))
    used = sum(app.process.cpu_times()[:2]) - used
    end = time.perf_counter()
    while True:
        await asyncio.sleep(0.1)
        pairs = zip(dragging, sent, strict=True)
        stale = sum(numbers.get(tab.seen[-1][1]) != out[-1][1] for tab, out in pairs)
        if not stale or time.perf_counter() - end > FINAL_S:
            break
    memory = app.memory_mb
    pictures = sum(len(tab.seen) for tab in dragging)
    times = [
        latency
        for tab, out in zip(dragging, sent, strict=True)
        for latency in latencies(out, tab.seen, numbers)
    ]
    size = sum(tab.bytes for tab in dragging) / max(pictures, 1)
    for tab in all_tabs:
        await tab.close()
    p50, p95 = np.quantile(times, (0.5, 0.95))
    return TabTimes(p50, p95, used / max(pictures, 1), size, stale, memory)


def measure() -> Section:
    """Measure five dragging tabs beside fifteen idle ones, and one tab to eight."""
    with running_app() as app:
        bare = app.memory_mb
        grown = [asyncio.run(drag_all(app, tabs, 0)) for tabs in GROWING]
    with running_app() as app:
        times = asyncio.run(drag_all(app, TABS, IDLE))
    live, state = LiveModel(), start_state(load_scene("dvf5000_first"))
    live.evaluate(state)
    moves = iter(np.linspace(-80.0, 80.0, 1000))
    model = best(lambda: live.evaluate(state.with_amplitude(KEY, float(next(moves)))), 50)
    load_text = f"{TABS} tabs at {RATE:g} positions a second beside {IDLE} idle ones"
    tick = 1.0 / RATE
    first_growth = grown[0]
    rows = [
        Row(f"latency, median, wall: {load_text}", times.median_s, "between two positions", tick),
        Row(
            f"latency, P95, wall: {load_text}",
            times.p95_s,
            "between two positions",
            tick,
            max_value=0.02,
        ),
        Row(
            "processor time of a picture, one tab",
            first_growth.picture_s,
            "the model alone",
            model,
            max_value=2.5e-3,
        ),
        Row("the same, each of the tabs", times.picture_s, "the model alone", model),
        Row(
            "bytes of a picture",
            times.size / 1e3,
            "one tab alone",
            first_growth.size / 1e3,
            "kB",
            max_value=60.0,
        ),
        Row("stale final values, + 1", times.stale + 1.0, "none, + 1", 1.0, "", max_ratio=1.0),
        Row(
            f"memory with {TABS + IDLE} tabs",
            times.memory_mb,
            "with none",
            bare,
            "MB",
            max_value=400.0,
        ),
    ]
    counts = [*map(float, GROWING)]
    growth = [
        Growth(
            "processor time of all pictures of a position",
            "tabs",
            counts,
            [n * f.picture_s for n, f in zip(GROWING, grown, strict=True)],
        ),
        Growth("memory of the server", "tabs", counts, [f.memory_mb for f in grown], "MB"),
    ]
    text = (
        "Clients that speak viser's protocol, without a browser. Latency is from sending a"
        " position until the numbers of that position, or of a later one, have come back."
    )
    return Section("Many tabs", text, rows, growth)
