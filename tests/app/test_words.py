"""What the panels say: histogram and probability, ranked bars, commands, help."""

import re
from dataclasses import replace

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.analysis.distribution import Histogram, Probability
from warpspace.analysis.nodes import Over
from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.app.evaluation.probability import Estimate
from warpspace.app.evaluation.sensitivities import rank_picture
from warpspace.app.panels.commands import Command, help_text, spell_change
from warpspace.app.readouts.gains import spell_ranking
from warpspace.app.readouts.html import message
from warpspace.app.readouts.probability import histogram_lines, spell_probability, spell_scatter
from warpspace.app.state.app_state import start_state

LIVE = LiveModel()
FRAME = LIVE.evaluate(start_state(load_scene("dvf5000_first")))


def estimated(probability, low, high, counts=(5, 10, 5)):
    return Estimate(
        Over.SAMPLED,
        20_000,
        41.0,
        74.0,
        129.0,
        Histogram(np.arange(len(counts) + 1) * 20.0, np.array(counts)),
        Probability(50.0, probability, low, high),
    )


def test_the_probability_is_said_with_its_interval():
    found = estimated(0.7131, 0.707, 0.7193)
    text = spell_probability(found)
    assert "71.3 %" in text
    assert "within <b>50 µm</b> at a random point" in text
    below = spell_scatter(found)
    assert "70.7 … 71.9 %" in below
    assert "20\u202f000 machines" in below
    assert "limit 50 µm" in below
    assert "74.0" in below


@pytest.mark.parametrize(
    ("share", "said"), [(0.0, "0.0 %"), (1.0, "100.0 %"), (0.99999, "99.9 %"), (1e-5, "0.1 %")]
)
def test_only_what_is_certain_reads_as_certain(share, said):
    assert f">{said}<" in spell_probability(estimated(share, share, share))


def test_bars_change_colour_at_the_limit():
    lines = histogram_lines(estimated(0.7, 0.6, 0.8, counts=(5, 10, 5, 2)))
    at, within, outside, limit = lines
    assert len({len(line) for line in lines}) == 1
    assert (np.diff(at) >= 0).all()
    middles = np.array([10.0, 30.0, 50.0 - 1e-6, 70.0])
    np.testing.assert_array_equal(np.interp(middles, at, within), [5, 10, 5, 0])
    np.testing.assert_array_equal(np.interp(middles, at, outside), [0, 0, 0, 2])
    drawn = ~np.isnan(limit)
    assert at[drawn].tolist() == [50.0, 50.0]
    assert limit[drawn].tolist() == [0.0, 1.0]


@pytest.mark.parametrize("limit_um", [10.0, 20.0, 50.0, 60.0, 80.0, 300.0])
def test_the_outline_encloses_all_machines_wherever_the_limit_is(limit_um):
    counts = (5, 10, 5, 2)
    found = estimated(0.7, 0.6, 0.8, counts=counts)
    found = replace(found, probability=replace(found.probability, spec_um=limit_um))
    at, within, outside, limit = histogram_lines(found)
    # each kind of bars is as large as its machines, 20 µm wide
    middles = (np.arange(4) + 0.5) * 20.0
    assert np.trapezoid(within, at) == 20.0 * np.sum(counts, where=middles <= limit_um)
    assert np.trapezoid(outside, at) == 20.0 * np.sum(counts, where=middles > limit_um)
    assert at[-1] > max(80.0, limit_um)
    assert set(at[~np.isnan(limit)]) == {limit_um}


def test_no_error_at_all_can_be_drawn():
    found = estimated(1.0, 0.99, 1.0, counts=(20_000,))
    assert "100.0 %" in spell_probability(found)
    assert np.max(histogram_lines(found)[1]) == 20_000


def test_messages_are_escaped():
    text = message("<script>alert(1)</script>", '"><b>')
    assert "<script>" not in text
    assert "<b>" not in text
    assert type(text) is str  # viser sends nothing else


def test_gain_bars_rank_the_worst_point():
    ranking = rank_picture(FRAME)
    assert ranking.error_um == pytest.approx(FRAME.statistics.max_um)
    text = spell_ranking(ranking)
    keys = re.findall(r'data-bar="(\w+)"', text)
    assert keys == [bar.key for bar in ranking.bars[:10]]
    assert f"{FRAME.statistics.max_um:.2f} µm" in text


def test_gain_bars_rank_by_what_the_errors_do():
    ranking = rank_picture(FRAME, middle=True, by_effect=True)
    moved = [bar.moved_um for bar in ranking.bars]
    assert moved == sorted(moved, reverse=True)
    assert sum(bar.along_um for bar in ranking.bars) == pytest.approx(ranking.error_um)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("amplitudes.EAX", "roll of X"),
        ("amplitudes.EAX, amplitudes.EBX", "roll of X and 1 more"),
        ("positions.B", "position of B"),
        ("shown.dark", "dark mode"),
        ("tolerances.own.EAX", "tolerance of roll of X"),
        ("specification.limit_um", "specification"),
        ("exclusions.excluded", "which errors are included"),
        ("exclusions.excluded.+EAX", "exclusion of roll of X"),
        ("exclusions.only.-EAX", "only roll of X"),
        ("exclusions.excluded.-EAX, exclusions.only.-EBX", "exclusion of roll of X and 1 more"),
        ("rotary.off.+2", "rotary traces"),
        ("scene.errors.functions.EXX, amplitudes.EXX, loaded", "positioning of X"),
        ("something_new", "something new"),
    ],
)
def test_changes_are_said_in_words(what, said):
    assert spell_change(what) == said


def test_help_lists_the_keys():
    command = Command("Redo", "Do it again", "Z", "cmd/ctrl+shift", lambda: None)
    assert command.keys == "Ctrl + Shift + Z"
    text = help_text((command, Command("Palette only", "", None, None, lambda: None)))
    assert "Ctrl + Shift + Z" in text
    assert "Palette only" not in text
