"""Command `convert`, and the direction and uncertainty options of others."""

import json
from pathlib import Path

import pytest

SCENE = """machine = "dvf5000"
[workspace]
X = [-275, 275]
[errors]
EYX = { forward = { ramp = 2 }, backward = 1 }
EC0Y = 20
[uncertainty]
EYX = 0.5
"""


def test_convert_writes_a_scene_with_the_same_field(warpspace, tmp_path: Path) -> None:
    target = tmp_path / "out.toml"
    wishes = ("--to", "component_errors=rotary:before_motion,X:before_motion")
    wishes += ("--to", "squareness=over_90", "--to", "measuring_line=Y:20/0/300")
    result = warpspace("convert", "dvf5000_first", *wishes, "-o", str(target), "--json")
    found = json.loads(result.out)
    assert found["largest_um"] < 3e-9
    assert found["changed"]["EB0Z"] == {"from": 18.1, "to": -18.1}
    text = target.read_text("utf-8")
    assert text.startswith("# Converted from dvf5000_first by warpspace convert: component_errors=")
    assert "measuring_line_mm = { Y = [20.0, 0.0, 300.0] }" in text
    assert "EB0Z" in warpspace("check", str(target)).out


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ("foo=3", "unknown convention 'foo'; expected one of component_errors"),
        ("squarenes=over_90", "did you mean 'squareness'"),
        ("squareness=up", "expected right_hand, over_90 or under_90"),
        ("zero_at=3", "expected positions of axes: X:0,Y:-225"),
        ("zero_at=X:nan", "expected positions of axes"),
        ("zero_at=Q:1", "no such axis; expected one of X, Y, Z, B, C"),
        ("measuring_line=X:1/2", "expected points in the frames of axes"),
        ("component_errors=sideways", "expected after_motion or before_motion"),
        ("straightness=C:end_point", "C is rotary"),
        ("reference=X:0", "the error at that point is"),
        ("reference=constants", "the scene holds no point still"),
    ],
)
def test_what_cannot_be_converted_is_refused_and_nothing_written(
    warpspace, tmp_path: Path, wish: str, message: str
) -> None:
    target = tmp_path / "out.toml"
    warpspace("convert", "dvf5000_first", "--to", wish, "-o", target).refused(message)
    assert not target.exists()


def test_fields_have_a_direction_and_an_uncertainty(warpspace, tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(SCENE)
    errors = {}
    for way in ("mean", "forward", "backward", "difference"):
        result = warpspace("field", str(path), "--at", "X=275", "--direction", way, "--json")
        errors[way] = json.loads(result.out)["points"][0]["error_um"][1]
    assert errors["forward"] - errors["backward"] == pytest.approx(1.0)
    assert errors["difference"] == pytest.approx(1.0)
    assert errors["mean"] - errors["backward"] == pytest.approx(0.5)
    result = warpspace("field", str(path), "--at", "X=275", "--uncertainty", "--json")
    assert json.loads(result.out)["points"][0]["uncertainty_um"] == [0.0, 0.5, 0.0]
    result = warpspace(
        "montecarlo", str(path), "--from", "uncertainty", "--samples", "500", "--json"
    )
    found = json.loads(result.out)
    assert (found["from"], found["distribution"]) == ("uncertainty", "normal")
    table = tmp_path / "f.csv"
    warpspace("export", str(path), "-o", str(table), "--grid", "2", "--direction", "difference")
    assert "reversal: forward − backward" in table.read_text("utf-8")
