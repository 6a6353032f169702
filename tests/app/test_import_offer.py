"""What files would bring with what a user says of them: format, axis, sign and variant."""

from dataclasses import replace

import pytest

from warpspace.app.documents.import_offer import (
    LONGEST_AXES,
    LONGEST_PROBLEM,
    Offer,
    Said,
    asking,
    offered,
    said_again,
)
from warpspace.app.readouts.html import message
from warpspace.app.readouts.import_preview import preview_html
from warpspace.exceptions import SceneError, UnsaidError, WarpspaceError
from warpspace.formats.compensation.compensate import Plan, compensate
from warpspace.formats.registry import formats
from warpspace.formats.source import Source, source_of_text
from warpspace.scene.library import load_scene

SCENE = load_scene("dvf5000_nominal")
COMP = "-20 0.001 0.003\n0 0.002 0.004\n20 0.005 0.006\n"
EXCHANGE = "[A0C]\nVALUE = 0.00003\n"
HOSTILE = "<img src=x onerror=alert(1)>\"'&"


def asked(text: str, name: str) -> Offer:
    """Offer a file that does not say enough."""
    source = source_of_text(text, name)
    with pytest.raises(UnsaidError) as caught:
        offered([source], SCENE)
    return asking([source], caught.value)


def test_an_axis_that_the_file_does_not_name_is_asked_for() -> None:
    offer = asked(COMP, "joint.comp")
    assert "which axis" in offer.problem
    assert offer.kind is not None
    assert offer.kind.name == "linuxcnc-comp"
    assert not offer.can_apply
    wrong = said_again(offer, Said(axes="Q7Q"), SCENE)
    assert "'Q7Q'" in wrong.problem
    assert not wrong.can_apply
    right = said_again(wrong, Said(axes=" y "), SCENE)
    assert right.can_apply
    assert right.made is not None
    assert set(right.made.scene.errors) == {"EYY"}


def test_a_format_that_is_not_recognised_is_asked_for() -> None:
    offer = asked("0\t0.001\t0.002\n", "data.dat")
    assert offer.kind is None
    assert "no format that is known" in offer.problem
    chosen = said_again(offer, Said(format="linuxcnc-comp"), SCENE)
    assert "which axis" in chosen.problem
    assert said_again(chosen, Said("linuxcnc-comp", "X"), SCENE).can_apply


def test_a_choice_that_does_not_fit_keeps_the_files_and_the_last_preview() -> None:
    good = offered([source_of_text("X [mm],EXX [um]\n-200,1\n200,2\n", "x.csv")], SCENE)
    assert good.can_apply
    bad = said_again(good, Said(format="heidenhain"), SCENE)
    assert bad.problem.startswith("x.csv: ")
    assert not bad.can_apply
    assert bad.sources == good.sources
    assert bad.reading is good.reading
    assert bad.made is good.made
    again = said_again(bad, Said(), SCENE)
    assert again.can_apply
    assert again.made is not None
    assert good.made is not None
    assert again.made.text == good.made.text


def test_sign_and_variant_are_those_of_the_format_or_none() -> None:
    offer = said_again(asked(COMP, "joint.comp"), Said(axes="X"), SCENE)
    typed = said_again(offer, Said(axes="X", variant="type-0"), SCENE)
    assert typed.reading is not None
    assert offer.reading is not None
    assert typed.reading.found.series[0].values[0] == pytest.approx(20002.0)
    enc = offered([source_of_text(ENC, "x.ini")], SCENE)
    turned = said_again(enc, Said(sign="correction"), SCENE)
    assert turned.reading is not None
    assert enc.reading is not None
    assert turned.reading.found.series[0].values == pytest.approx(
        -enc.reading.found.series[0].values
    )
    # neither is one of a table of measured errors: they are left out, not refused
    csv = offered([source_of_text("X [mm],EXX [um]\n-200,1\n200,2\n", "x.csv")], SCENE)
    left = said_again(csv, Said(sign="correction", variant="type-0"), SCENE)
    assert left.can_apply
    assert left.said == Said()


def test_the_alternative_model_is_chosen_by_its_variant() -> None:
    standard = offered([source_of_text(EXCHANGE, "e.exc")], SCENE)
    other = said_again(standard, Said(variant="alternative"), SCENE)
    assert standard.made is not None
    assert other.made is not None
    assert set(standard.made.scene.errors) == {"EA0C"}
    assert set(other.made.scene.errors) == {"EA0C", "EAC", "EBC"}


def test_only_what_a_choice_may_mend_is_asked_for() -> None:
    for text, name in (
        ("X [mm],EXX [um]\n0,1\n0,2\n", "bad.csv"),
        ("X [mm],EXX [um]\n0,1\n9000,2\n", "far.csv"),
        ("X [mm],EXX\n0,1\n", "unit.csv"),
    ):
        with pytest.raises(SceneError) as caught:
            offered([source_of_text(text, name)], SCENE)
        assert not isinstance(caught.value, UnsaidError)


def test_what_is_said_is_clamped_and_shown_escaped() -> None:
    long = said_again(asked(COMP, "joint.comp"), Said(axes=HOSTILE * 100_000), SCENE)
    assert 0 < len(long.problem) <= LONGEST_PROBLEM
    assert len(long.said.fitting(long.kind).axes) == LONGEST_AXES
    assert "<img" not in message(long.problem, "import-problem")
    found = offered([source_of_text("X [mm],EXX [um]\n-200,1\n200,2\n", "x.csv")], SCENE)
    assert found.reading is not None
    page = preview_html(found.reading, [HOSTILE], HOSTILE, [HOSTILE], stale=True)
    assert "<img" not in page
    assert "As it was last read" in page
    assert "As it was last read" not in preview_html(found.reading, ["x"], "m", [])


ENC = (
    "$AA_ENC_COMP[0,0,X]=0.001\n$AA_ENC_COMP[0,1,X]=0.002\n$AA_ENC_COMP_STEP[0,X]=10\n"
    "$AA_ENC_COMP_MIN[0,X]=0\n$AA_ENC_COMP_MAX[0,X]=10\n"
)


def files() -> list[list[Source]]:
    """Give files of every format, and some of none."""
    scene = load_scene("dvf5000_first")
    found: list[list[Source]] = []
    for kind in formats():
        if kind.can_write:
            points = 3 if not kind.grid.startswith("none") else None
            made = compensate(scene, Plan(kind.name, points), 3)
            found.append(
                [
                    source_of_text(text, f"c{add or kind.endings[0]}")
                    for add, text in made.files.items()
                ]
            )
    return [*found, *([source_of_text(text, "x.txt")] for text in (COMP, ENC, "a b\n", "{}[]=\n#"))]


def test_any_files_as_any_format_are_read_or_refused_in_words() -> None:
    read = 0
    for sources in files():
        for kind in formats():
            start = Offer(tuple(sources))
            for axes in ("", "X", "AX1=X, Q=B"):
                found = said_again(start, Said(kind.name, axes), SCENE)
                assert found.can_apply == (not found.problem)
                read += found.can_apply
    assert read >= len(formats())


def test_an_unknown_format_is_a_message() -> None:
    offer = Offer((source_of_text(COMP, "a.comp"),))
    found = said_again(offer, Said(format="nothing"), SCENE)
    assert "nothing" in found.problem
    with pytest.raises(WarpspaceError):
        offered(replace(offer, said=Said()).sources, SCENE)
