"""Symptoms in words: closed forms of a circle, a plate, a taper and a step; refused texts."""

import numpy as np
import pytest

from warpspace import load_scene
from warpspace.diagnosis.causes import CauseSet
from warpspace.diagnosis.diagnose import Diagnose
from warpspace.diagnosis.symptoms import FORMS, SYMPTOM_SHARE, read_symptom
from warpspace.exceptions import OptionError

SCENE = """title = "test"
[machine]
chain = "wFXYZt"
[workspace]
X = [-250, 250]
Y = [-200, 200]
Z = [-300, 0]
[tolerances]
default = { translation = 10, rotation = 20, squareness = 25 }
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, "utf-8")
    return load_scene(str(path))


def explained(scene, text, cause, halves):
    """Values of the quantities of a symptom with one cause, half-widths, in shares of the text."""
    causes = CauseSet(scene)
    observations = read_symptom(text, scene).observe(causes)
    names = [each.name for each in causes.causes]
    sizes = [each.shape.shape[1] for each in causes.causes]
    start = sum(sizes[: names.index(cause)])
    assert sizes[names.index(cause)] == 1
    share = observations.columns[:, start] * halves
    return share * SYMPTOM_SHARE, observations.deviations * SYMPTOM_SHARE


def test_a_squareness_makes_a_circle_oval_at_45_degrees(scene):
    """r = −γ·R/2·sin 2φ, so that the diameters differ by 2·γ·R: 60 µm on R 50 is 600 µrad."""
    text = "circle of 100 mm oval by 60 µm at 45°, same in both directions"
    found, stated = explained(scene, text, "EC0Y", -600.0 / 25.0)
    assert found == pytest.approx(stated, abs=1e-5)
    assert stated == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-12)


def test_a_lag_makes_an_oval_that_turns_with_the_direction(scene):
    """X lags by g·v: r = g/2·sin 2φ against the direction, the diameters differ by 2·g."""
    text = "circle of 100 mm oval by 40 µm at 45°, opposite in both directions"
    found, stated = explained(scene, text, "servo mismatch of X", -20.0 / 10.0)
    assert np.abs(found) == pytest.approx(np.abs(stated), abs=1e-4)
    assert stated == pytest.approx([0.0, 0.0, 0.0, 1.0], abs=1e-12)


def test_an_oval_along_the_axes_is_a_difference_of_scales(scene):
    """A warm scale expands all axes alike: the circle stays round."""
    text = "circle of 100 mm oval by 60 µm at 0°"
    found, stated = explained(scene, text, "scale temperature", 5.0)
    assert stated == pytest.approx([1.0, 0.0], abs=1e-12)
    assert found == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_squareness_makes_the_diagonals_of_a_plate_differ(scene):
    """(a², b²) sheared by γ: d₁ − d₂ = 2·γ·a·b/√(a² + b²); positive γ opens the angle."""
    gamma_urad = 200.0 / (2.0 * 300.0 * 200.0 / np.hypot(300.0, 200.0)) * 1e3
    text = "plate of 300 × 200 mm: diagonals differ by 0.2 mm"
    found, stated = explained(scene, text, "EC0Y", -gamma_urad / 25.0)
    assert found == pytest.approx(stated, rel=1e-6)


def test_a_step_is_the_reversal(scene):
    found, stated = explained(scene, "step of 20 µm where Y reverses", "reversal of Y", 2.0)
    assert found == pytest.approx(stated, rel=1e-9)


def test_a_pitch_of_x_makes_slots_taper_that_are_cut_at_two_heights(tmp_path):
    """wFXZt: along Z across X the width changes by the pitch of X times the way along Z."""
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.replace("wFXYZt", "wXFZt").replace("Y = [-200, 200]\n", ""), "utf-8")
    scene = load_scene(str(path))
    causes = CauseSet(scene)
    symptom = read_symptom("taper 0.03 on 200 along Z across X", scene)
    names = [cause.name for cause in causes.causes]
    at = names.index("EBX")
    cause = causes.causes[at]
    # a pitch of ±10 µrad at the flanks, linear between them; the shapes contain it
    ramp = np.linspace(-12.5, 12.5, 5)
    coefficients = np.linalg.lstsq(cause.shape, ramp / cause.half_width, rcond=None)[0]
    start = sum(each.shape.shape[1] for each in causes.causes[:at])
    columns = symptom.observe(causes).columns[:, start : start + len(coefficients)]
    width_um = columns @ coefficients * SYMPTOM_SHARE * 30.0
    # 20 µrad over 200 mm
    assert np.abs(width_um) == pytest.approx([4.0], rel=1e-6)


@pytest.mark.parametrize("text", FORMS)
def test_every_example_is_understood_and_says_what_it_assumes(scene, text):
    symptom = read_symptom(text, scene)
    assert symptom.assumed
    assert np.isfinite(symptom.observe(CauseSet(scene)).deviations).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("circle of 100 mm wobbly by 30 µm at 45°", "unknown word 'wobbly'"),
        ("circle of 100 mm", "expected for instance circle of 100 mm oval by 30"),
        ("circle of 1000 mm oval by 30 µm at 45°", "leaves the working volume"),
        ("circle in XZ of 100 mm oval by 0 µm at 45°", "0 µm; expected above 0"),
        ("plate of 600 x 200 mm diagonals differ by 0.2 mm", "600 mm along X; expected"),
        ("taper 0.03 on 300 along X across X", "expected two of X, Y, Z"),
        ("taper 0.03 on 300 along X across W", "expected two of X, Y, Z"),
        ("step of 20 µm where W reverses", "unknown axis 'W'"),
        ("step of 20 where Y reverses", "20000 µm; expected above 0, at most 10000 µm"),
        ("", "expected for instance"),
        ("step " * 60, "expected at most 200"),
    ],
)  # fmt: skip
def test_other_texts_are_refused(scene, text, message):
    with pytest.raises(OptionError) as caught:
        Diagnose(symptoms=(text,)).run(scene, lambda _: None)
    assert message in str(caught.value)


def test_contradictory_symptoms_are_named(scene):
    texts = tuple(f"circle of 100 mm oval by {size} µm at 45°" for size in (60, 10))
    with pytest.raises(OptionError, match=r"60 µm.*and.*10 µm.*contradict"):
        Diagnose(symptoms=(*texts, "step of 20 µm where Y reverses")).run(scene, lambda _: None)
    with pytest.raises(OptionError, match="no readings, no symptoms"):
        Diagnose().run(scene, lambda _: None)


def test_a_scene_without_tolerances_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.partition("[tolerances]")[0], "utf-8")
    with pytest.raises(OptionError, match=r"EXX.*have no tolerance"):
        Diagnose(symptoms=("step of 20 µm where Y reverses",)).run(
            load_scene(str(path)), lambda _: None
        )
