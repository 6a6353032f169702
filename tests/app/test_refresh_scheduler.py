"""Times at which panels are rendered again, by a clock of the test."""

from types import SimpleNamespace

import pytest

from warpspace.app.panels.panel import PAUSE_S, Panel, Refresh
from warpspace.app.server import refresh_scheduler
from warpspace.app.server.refresh_scheduler import IDLE_S, MAX_DELAY_S, THROTTLE_S

ANY = None  # a picture that nothing depends on


class _Panel(Panel):
    def __init__(self, refresh):
        self.refresh, self.urgent = refresh, 0

    def dependencies(self, picture):
        return (self.urgent,)


@pytest.fixture
def clock():
    return SimpleNamespace(now=100.0)


@pytest.fixture
def scheduler(clock):
    return refresh_scheduler.RefreshScheduler(lambda: clock.now)


PANELS = {refresh: _Panel(refresh) for refresh in Refresh}


def test_only_immediate_and_throttled_panels_are_rendered_with_a_picture(scheduler):
    due = {refresh for refresh, panel in PANELS.items() if scheduler.is_due(panel, ANY)}
    assert due == {Refresh.IMMEDIATE, Refresh.THROTTLED}


def test_a_throttled_panel_waits_unless_its_first_dependency_changes(scheduler, clock):
    panel = _Panel(Refresh.THROTTLED)
    assert scheduler.is_due(panel, ANY)
    clock.now += 0.9 * THROTTLE_S
    assert not scheduler.is_due(panel, ANY)
    panel.urgent = 1
    assert scheduler.is_due(panel, ANY)
    clock.now += 0.9 * THROTTLE_S
    assert not scheduler.is_due(panel, ANY)
    clock.now += 0.2 * THROTTLE_S
    assert scheduler.is_due(panel, ANY)


def test_a_picture_starts_a_debounced_pass_and_then_an_idle_one(scheduler, clock):
    assert scheduler.due_in_s is None
    scheduler.record_picture()
    assert scheduler.due_in_s == pytest.approx(PAUSE_S)
    clock.now += PAUSE_S
    assert scheduler.due_in_s == 0.0
    assert scheduler.start_pass(PANELS.values()) is None
    assert [panel.refresh for panel in scheduler.queue] == [Refresh.THROTTLED, Refresh.DEBOUNCED]
    assert scheduler.due_in_s == 0.0  # until the queue is empty
    scheduler.queue.clear()
    assert scheduler.due_in_s == pytest.approx(IDLE_S - PAUSE_S)
    assert scheduler.start_pass(PANELS.values()) == frozenset()
    assert [panel.refresh for panel in scheduler.queue] == [Refresh.IDLE]
    scheduler.queue.clear()
    assert scheduler.due_in_s is None


def test_changes_postpone_debounced_panels_up_to_a_limit(scheduler, clock):
    for _ in range(round(MAX_DELAY_S / PAUSE_S) * 2):
        scheduler.record_picture()
        clock.now += 0.5 * PAUSE_S
        if scheduler.due_in_s == 0.0:
            break
        assert scheduler.due_in_s <= 0.5 * PAUSE_S + 1e-9
    assert clock.now - 100.0 == pytest.approx(MAX_DELAY_S, abs=PAUSE_S)


def test_a_restart_postpones_the_idle_pass_which_renders_the_panels_it_names(scheduler, clock):
    panel = PANELS[Refresh.DEBOUNCED]
    scheduler.restart_idle(panel)
    clock.now += 0.8 * IDLE_S
    scheduler.restart_idle()
    assert scheduler.due_in_s == pytest.approx(IDLE_S)
    clock.now += IDLE_S
    assert scheduler.start_pass(PANELS.values()) == {panel}
    assert [*scheduler.queue] == [PANELS[Refresh.IDLE], panel]
    scheduler.queue.clear()
    scheduler.restart_idle()
    assert scheduler.start_pass([]) == frozenset()
