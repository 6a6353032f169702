"""Files of readings that cannot be used: file, line and what was expected."""

import pytest

from bench_scenes import scene_with
from warpspace.bench.data import parse_table, unit_notes
from warpspace.bench.registry import bench_names, find_test
from warpspace.bench.run import run_test
from warpspace.exceptions import OptionError, SceneError, UnknownNameError

HEADER = "run,direction,target_mm,deviation_um\n"
GOOD = "".join(
    f"{run},{sign},{target},{target / 10 + run}\n"
    for run in (1, 2) for sign in "+-" for target in (0, 10, 20)
)  # fmt: skip
BAD = {
    "nothing": ("", "is empty", "run,direction,target_mm,deviation_um"),
    "no readings": (HEADER, "no readings below its header"),
    "a column is missing": (
        "run,direction,target_mm\n1,+,0\n", "line 1: column 'deviation_um' not found",
    ),
    "a column in another unit": (
        "run,direction,target_mm,deviation_mm\n1,+,0,1\n",
        "line 1: column 'deviation_um' not found", "is it 'deviation_mm'?",
    ),
    "nan": (HEADER + "1,+,0,1\n1,+,10,nan\n", "line 3, deviation_um: \"nan\"; expected a finite"),
    "text": (HEADER + "1,+,zero,1\n", "line 2, target_mm: \"zero\"; expected a finite number"),
    "empty cell": (HEADER + "1,+,0,\n", "line 2, deviation_um: \"\"; expected a finite number"),
    "direction": (HEADER + "1,up,0,1\n", "line 2, direction: \"up\"; expected + or -"),
    "decimal commas": (HEADER + "1,+,0,1,5\n", "line 2: 5 fields; expected 4", "decimal commas?"),
    "nanometres": (HEADER + "1,+,0,1234567\n", "line 2, deviation_um: 1.23457e+06", "in nm?"),
    "one target": (HEADER + "1,+,0,1\n2,+,0,2\n", "has 1 target; expected at least 2"),
    "one run": (
        HEADER + "1,+,0,1\n1,+,10,2\n", "target 0 mm, direction +: 1 readings; expected at least 2",
    ),
    "a target is missing on the way back": (
        HEADER + GOOD + "3,+,30,1\n4,+,30,1\n", "target 30 mm, direction -: 0 readings",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_positioning_data(case: str, tmp_path) -> None:
    text, *fragments = BAD[case]
    path = tmp_path / "data.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        run_test(scene_with(), find_test("positioning")(axis="X"), path)
    for fragment in (str(path), *fragments):
        assert fragment in str(caught.value)


def test_all_problems_of_a_file_are_said_at_once(tmp_path) -> None:
    path = tmp_path / "data.csv"
    path.write_text(HEADER + "1,+,0,nan\n1,x,0,1\n", encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        run_test(scene_with(), find_test("positioning")(), path)
    assert len(caught.value.problems) == 2


@pytest.mark.parametrize("text", ["\ufeff" + HEADER + GOOD, (HEADER + GOOD).replace("\n", "\r\n")])
def test_marks_and_line_ends_of_other_systems(text: str, tmp_path) -> None:
    path = tmp_path / "data.csv"
    path.write_bytes(text.encode("utf-8"))
    found = run_test(scene_with(), find_test("positioning")(), path).measured
    assert found is not None
    assert found.outcome["E_um"] == pytest.approx(2.0)


def test_columns_may_stand_in_any_order_among_others() -> None:
    columns = find_test("sphere").columns
    table = parse_table("note,z_um,y_um,x_um,angle_deg\na,3,2,1,0\n", columns, "x.csv")
    assert table["x_um"][0] == 1.0
    assert table["z_um"][0] == 3.0


OTHERS = {
    "circular": ("angle_deg,radial_um\n0,1\n90,2\n", "has 2 readings; expected at least 8"),
    "diagonals": ("diagonal,position_mm,deviation_um\nQPP,0,0\n", "'QPP'; expected one of PPP"),
    "straightness": ("position_mm,deviation_um\n0,1\n5,2\n", "has 2 positions; expected"),
    "squareness": ("line,position_mm,deviation_um\nZ,0,1\n", "'Z'; expected X or Y (--plane XY)"),
    "rotary-axis": (
        "angle_deg,x_um,y_um,z_um,a_urad,b_urad\n0,0,0,0,0,0\n", "has 1 positions; expected",
    ),
    "sphere": (
        "angle_deg,x_um,y_um,z_um\n" + "5,0,0,0\n" * 6, "all readings are at one angle",
    ),
    "ball-plate": (
        "position,row,column,x_um,y_um,z_um\n1,1,9,0,0,0\n", "column: 9; expected a whole number",
    ),
    "cone-frustum": ("angle_deg,radial_um\n0,1\n", "has 1 readings; expected at least 8"),
}  # fmt: skip


@pytest.mark.parametrize("name", OTHERS)
def test_too_few_or_impossible_readings(name: str, tmp_path) -> None:
    text, fragment = OTHERS[name]
    path = tmp_path / "data.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        run_test(scene_with(), find_test(name)(), path)
    assert fragment in str(caught.value)


def test_every_test_reads_what_its_model_reads(tmp_path) -> None:
    """The readings of the model, written as a file, give the same numbers again."""
    scene = scene_with("dvf5000_first", EXX=("ramp", 8.0), EC0Y=20.0, EA0C=15.0, EZC=3.0)
    for name in bench_names():
        test = find_test(name)()
        model = run_test(scene, test).model
        path = tmp_path / f"{name}.csv"
        path.write_text(_as_csv(name, model), encoding="utf-8")
        both = run_test(scene, test, path)
        assert both.measured is not None
        for quantity in both.measured.outcome.quantities:
            assert quantity.value == pytest.approx(model.outcome[quantity.key], abs=1e-6), name


def _as_csv(name: str, model) -> str:
    marks, readings = model.plan.marks, model.readings
    sign = {1.0: "+", -1.0: "-"}
    if name == "positioning":
        rows = [
            f"{run},{sign[w]},{t:.9f},{r:.9f}"
            for run in (1, 2)
            for w, t, r in zip(marks["way"], marks["target"], readings, strict=True)
        ]  # fmt: skip
        return "\n".join([HEADER.strip(), *rows])
    if name == "circular":
        rows = [
            f"{sign[s]},{a:.9f},{r:.9f}"
            for s, a, r in zip(marks["sense"], marks["angle_deg"], readings, strict=True)
        ]
        return "\n".join(["direction,angle_deg,radial_um", *rows])
    if name == "diagonals":
        names = ("PPP", "NPP", "PNP", "PPN")
        rows = [
            f"{names[int(d)]},{sign[w]},{p:.9f},{r:.9f}"
            for d, w, p, r in zip(
                marks["diagonal"], marks["way"], marks["position_mm"], readings, strict=True
            )
        ]
        return "\n".join(["diagonal,direction,position_mm,deviation_um", *rows])
    if name in {"straightness", "squareness"}:
        lines = marks.get("line", marks["way"] * 0.0)
        rows = [
            f"{'XY'[int(line)]},{sign[w]},{p:.9f},{r:.9f}"
            for line, w, p, r in zip(
                lines, marks["way"], marks["position_mm"], readings, strict=True
            )
        ]
        return "\n".join(["line,direction,position_mm,deviation_um", *rows])
    if name == "cone-frustum":
        rows = [f"{a:.9f},{r:.9f}" for a, r in zip(marks["angle_deg"], readings, strict=True)]
        return "\n".join(["angle_deg,radial_um", *rows])
    if name == "ball-plate":
        count = len(readings) // 3
        rows = [
            ",".join(
                [f"{marks[mark][i] + 1:g}" for mark in ("position", "row", "column")]
                + [f"{value:.9f}" for value in readings.reshape(3, -1)[:, i]]
            )
            for i in range(count)
        ]
        return "\n".join(["position,row,column,x_um,y_um,z_um", *rows])
    heads = ["x_um", "y_um", "z_um", "a_urad", "b_urad", "c_urad"]
    channels = readings.reshape(3 if name == "sphere" else 6, -1)
    angle = marks["angle_deg"][: channels.shape[1]]
    rows = [",".join(f"{value:.9f}" for value in (a, *channels[:, i])) for i, a in enumerate(angle)]
    return "\n".join([",".join(["angle_deg", *heads[: len(channels)]]), *rows])


def test_thousandfold_readings_are_said() -> None:
    import numpy as np

    model = np.array([0.0, 5.0, 10.0])
    assert unit_notes(model * 1.4, model, "µm") == ()
    (text,) = unit_notes(model * 1000.0, model, "µm")
    assert "1,000 times" in text
    assert "in nm?" in text
    (text,) = unit_notes(model / 1000.0, model, "µm")
    assert "in mm?" in text
    assert unit_notes(model * 1000.0, model * 0.0, "µm") == ()


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("positioning", {"axis": "Q"}, "axis 'Q'"),
        ("positioning", {"targets": 1}, "--targets: 1; expected 2 to"),
        ("positioning", {"start": 5.0, "end": 5.0}, "expected start below end"),
        ("circular", {"start_deg": 0.0, "end_deg": 400.0}, "expected above 0 and at most 360"),
        ("circular", {"rotary": "X"}, "axis X is not rotary"),
        ("straightness", {"axis": "C"}, "axis C is not linear"),
        ("straightness", {"axis": "X", "across": "x"}, "expected one across it"),
        ("sphere", {"ball": (900.0, 0.0, 0.0)}, "cannot reach the ball"),
        (
            "sphere",
            {"start": 0.0, "end": 360.0, "ball": (240.0, 0.0, 100.0)},
            "leaves the travel: Y",
        ),
        ("ball-plate", {"pitch_mm": 200.0}, "--pitch 200 mm"),
        ("cone-frustum", {"radius_mm": 500.0}, "the cone leaves the travel"),
        ("cone-frustum", {"half_apex_deg": 90.0}, "--half-apex 90"),
        ("sphere", {"tool_extension_mm": 1e6}, "--tool-extension"),
    ],
)
def test_tests_that_cannot_be_run(name: str, options: dict, message: str) -> None:
    with pytest.raises((OptionError, UnknownNameError), match=message):
        run_test(scene_with(), find_test(name)(**options))


@pytest.mark.parametrize("name", ["rotary-axis", "sphere", "cone-frustum"])
def test_machines_without_rotary_axes_are_refused(name: str) -> None:
    with pytest.raises(OptionError, match="rotary ax"):
        run_test(scene_with("machine_c_frame_mill"), find_test(name)())


def test_a_hundred_thousand_readings_are_evaluated_at_once() -> None:
    import numpy as np

    from warpspace.bench.evaluation.lines import reference_lines
    from warpspace.bench.kinds.positioning import target_statistics

    position = np.repeat(np.linspace(-250.0, 250.0, 10_000), 10)
    way = np.tile([1.0, -1.0], 50_000)
    found = target_statistics(position, way, 1e-4 * position**2)
    np.testing.assert_allclose(found.mean, 1e-4 * found.target**2 + np.zeros((2, 1)), atol=1e-7)
    np.testing.assert_allclose(found.deviation, 0.0, atol=1e-9)
    places = np.linspace(-250.0, 250.0, 100_001)
    lines = reference_lines(places, 1e-4 * places**2)
    assert lines["minimum_zone"].deviation_um == pytest.approx(6.25, abs=1e-6)


def test_the_narrowest_band_is_found_among_all_slopes() -> None:
    import numpy as np

    from warpspace.bench.evaluation.lines import reference_lines

    random = np.random.default_rng(7)
    for _ in range(20):
        x, y = np.sort(random.uniform(-9.0, 9.0, 30)), random.normal(size=30)
        slopes = np.linspace(-5.0, 5.0, 20_001)
        heights = np.ptp(y - slopes[:, None] * x, axis=-1)
        found = reference_lines(x, y)["minimum_zone"].deviation_um
        assert found <= heights.min() + 1e-12
        assert found == pytest.approx(heights.min(), abs=0.01)
