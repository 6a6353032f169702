"""Only and exclude make amplitudes count as zero without touching them."""

from warpspace.app.state.exclusions import Exclusions

AMPLITUDES = {"EAX": 5.0, "EBX": -2.0, "EC0Y": 23.1}


def test_nothing_silenced_is_the_same_mapping():
    assert Exclusions().effective(AMPLITUDES) is AMPLITUDES


def test_what_is_excluded_is_zero():
    found = Exclusions().with_excluded("EAX", True).effective(AMPLITUDES)
    assert found == {**AMPLITUDES, "EAX": 0.0}


def test_only_takes_part_alone_and_two_together():
    exclusions = Exclusions().with_only("EAX", True)
    assert exclusions.effective(AMPLITUDES) == {"EAX": 5.0, "EBX": 0.0, "EC0Y": 0.0}
    both = exclusions.with_only("EBX", True)
    assert both.effective(AMPLITUDES) == {"EAX": 5.0, "EBX": -2.0, "EC0Y": 0.0}


def test_mute_wins_over_solo_and_all_comes_back():
    exclusions = Exclusions().with_only("EAX", True).with_excluded("EAX", True)
    assert set(exclusions.effective(AMPLITUDES).values()) == {0.0}
    assert not exclusions.with_only("EAX", False).with_excluded("EAX", False)


def test_what_another_machine_lacks_is_forgotten():
    exclusions = Exclusions(frozenset({"EAX"}), frozenset({"EXA"}))
    assert exclusions.within(AMPLITUDES) == Exclusions(frozenset({"EAX"}))
