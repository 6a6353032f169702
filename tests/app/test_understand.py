"""Why a point is off, the best single adjustment, cards of proposals, gains."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from app.parts import LIVE, lone_part, part_of
from warpspace.app.evaluation.budget import pick_worst, with_picked
from warpspace.app.state.app_state import start_state
from warpspace.app.state.tree import put
from warpspace.app.tasks.analysis import AnalysisPart
from warpspace.app.tasks.improve import BestPart
from warpspace.app.tasks.understand import VolumePart, WorstPart
from warpspace.scene.library import load_scene, scene_names

STATE = start_state(load_scene("dvf5000_first"))
NUMBER = r"[+−]?\d+\.\d"


def html_of(part, state=STATE):
    return "".join(part.pieces(LIVE.evaluate(state)).values())


def wait(part):
    while part._jobs.busy:
        time.sleep(0.01)


def value(text):
    return float(text.replace("−", "-"))


@pytest.mark.parametrize("name", scene_names())
def test_what_is_said_of_the_worst_point_adds_up_to_its_error(name):
    state = start_state(load_scene(name), nodes=5)
    html = html_of(lone_part(WorstPart), state)
    if "No error acts" in html:
        return
    shown = value(re.search(rf"why ({NUMBER}) µm", html)[1])
    causes = html[html.index("ws-causes") : html.index('data-piece="best"')]
    parts = [value(one) for one in re.findall(rf"<td>({NUMBER})</td>", causes)]
    assert sum(parts) == pytest.approx(shown, abs=0.05 * (len(parts) + 1) + 1e-9)


def test_the_worst_point_of_the_thesis_and_another_one():
    part = lone_part(WorstPart)
    assert "why 51.7 µm" in html_of(part)
    assert re.search(r'title="squareness of Z to Y[^"]*">EA0Z</b></th><td>\+49.1', html_of(part))
    typed = part.take(STATE, "set.at", "X 0 Y 0 Z −280")
    assert "This point" in html_of(part, typed)
    assert part.take(typed, "forget", "").picked is None
    part.context.shown = LIVE.evaluate(STATE)
    asked = part.take(STATE, "lever", "EA0Z")
    assert (asked.lever, asked.picked) == ("EA0Z", pick_worst(part.context.shown))
    assert "mm across the axis" in html_of(part, asked)
    for word in ("<img>", "", "x" * 500):
        assert part.take(STATE, "lever", word).lever == ""
        assert "<img" not in html_of(part, part.take(STATE, "set.at", word))


def test_the_best_adjustment_is_that_of_repair_and_is_applied_only_while_it_holds():
    part = lone_part(BestPart)
    assert "Searching" in html_of(part)
    wait(part)
    html = html_of(part)
    for words in ("EA0Z 33.9 → 30.0 µrad", "51.7 → 46.1 µm", "30.9 → 28.3 µm"):
        assert words in html
    applied = part.take(STATE, "apply", "0")
    assert LIVE.evaluate(applied).statistics.max_um == pytest.approx(46.09, abs=0.01)
    assert applied.comparison.b is not None
    previewed = part.take(STATE, "preview", "0")
    assert previewed.amplitudes == STATE.amplitudes
    assert LIVE.evaluate(previewed).statistics.max_um == pytest.approx(46.09, abs=0.01)
    moved = STATE.with_amplitude("EAX", 9.0)
    assert "disabled" in html_of(part, moved)
    wait(part)
    for state, word, number in ((STATE, "apply", "0"), (moved, "apply", "7"), (moved, "x", "0")):
        assert part.take(state, word, number) is state


def test_an_excluded_error_is_neither_adjusted_nor_lost():
    state = put(STATE, "exclusions.excluded", "+EA0Z")
    part = lone_part(BestPart)
    html_of(part, state)
    wait(part)
    assert "EA0Z" not in html_of(part, state)
    applied = part.take(state, "apply", "0")
    assert applied.amplitudes["EA0Z"] == STATE.amplitudes["EA0Z"]


def test_numbers_of_the_volume_and_gains_at_the_point_that_was_asked_about():
    opened = replace(STATE, page=replace(STATE.page, open=frozenset({"volume", "gains"})))
    html = html_of(lone_part(VolumePart), opened)
    for words in ("30.89 µm", "51.72 µm", "550 × 450 × 400 mm"):
        assert words in html
    part = part_of(AnalysisPart, "gains")
    html_of(part, opened)
    wait(part)
    middle = html_of(part, opened)
    assert "X 0, Y 0, Z −280" in middle
    asked = with_picked(opened, pick_worst(LIVE.evaluate(opened)))
    html_of(part, asked)
    wait(part)
    assert "X 275, Y −225, Z −480" in html_of(part, asked)
    assert np.isfinite(part._answer[1].gains[0].norm)
