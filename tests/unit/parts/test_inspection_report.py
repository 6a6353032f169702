"""Inspection reports: how tables are read, what is refused, and measurands in closed form."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from bench_scenes import scene_with
from simulated_plates import bundled_plates, layout, measured, report_text
from warpspace.analysis.description import ignore_progress
from warpspace.cli.analyses import command_of
from warpspace.cli.file_arguments import guarded
from warpspace.exceptions import SceneError, WarpspaceError
from warpspace.parts.inspection_comparison import seal_prediction
from warpspace.parts.inspection_report import is_report, load_report, parse_report
from warpspace.parts.part import Part
from warpspace.parts.part_shape import PartShape, align
from warpspace.parts.workpiece import load_workpiece
from warpspace.resources import assets_dir
from warpspace.scene.library import load_scene, parse_scene
from workbooks import xlsx

HEAD = "Nom X;Nom Y;Meas X;Meas Y\n"
ROWS = "0;0;0.001;0\n100;0;100.002;0\n0;100;0;100.003\n"
READ_UM = [[1.0, 0.0], [2.0, 0.0], [0.0, 3.0]]
TABLES = {
    "semicolons": HEAD + ROWS,
    "title": "Report 17\nOperator: X Y\n\n" + HEAD + ROWS,
    "order": "Y Ist;Soll Y;X Ist;X Soll\n0;0;0.001;0\n0;0;100.002;100\n100.003;100;0;0\n",
    "deviations": "hole,nominal_x,nominal_y,dev_x [µm],dev_y [µm]\n"
    "A,0,0,1,0\nB,100,0,2,0\nC,0,100,0,3\n",
    "blanks": "Nominal X   Nominal Y   Actual X   Actual Y\n"
    " 0   0   0.001   0\n 100   0   100.002   0\n 0   100   0   100.003\n",
    "decimal commas": "Nom X\tNom Y\tErr X\tErr Y\n"
    "0\t0\t0,001\t0\n100\t0\t0,002\t0\n0\t100\t0\t0,003\n",
    "repeated header": HEAD + ROWS[:12] + HEAD + ROWS[12:],
    "tolerances": HEAD.replace("\n", ";Upper Tol;Comment\n") + ROWS.replace("\n", ";0.1;ok\n"),
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_tables_of_any_order_and_mark_have_the_same_deviations(text):
    report = parse_report(text, "r.txt")
    assert is_report(text)
    np.testing.assert_allclose(report.nominal_mm[:, :2], [[0, 0], [100, 0], [0, 100]])
    np.testing.assert_allclose(1e3 * report.deviation_mm, READ_UM, atol=1e-9)


def test_units_are_those_of_headings_or_of_a_line_above():
    text = "Units: inch\n\n" + HEAD + "0;0;0.001;0\n1;0;1.002;0\n"
    in_line = parse_report(text, "r.txt")
    in_heading = parse_report(text.split("\n", 1)[1].replace("Nom X", "Nom X (in)"), "r.txt")
    for report in (in_line, in_heading):
        assert report.nominal_mm[1, 0] == pytest.approx(25.4)
        assert report.deviation_mm[1, 0] == pytest.approx(0.0508)
        assert report.notes == ()
    assert parse_report(HEAD + ROWS, "r.txt").notes == ("r.txt: no unit is stated; read in mm",)


def test_uncertainties_are_of_a_coordinate():
    rows = "0;0;0;0;3\n100;0;0;0;4\n"
    expanded = parse_report(
        HEAD.replace("\n", ";U95 [µm]\n") + rows.replace("100;0;0", "100;0;100"), "r"
    )
    standard = parse_report(
        HEAD.replace("\n", ";u_um\n") + rows.replace("100;0;0", "100;0;100"), "r"
    )
    np.testing.assert_allclose([expanded.u_um, standard.u_um], [[1.5, 2.0], [3.0, 4.0]])


REFUSED = {
    "Meas X;Meas Y\n0;0\n1;1\n": "has no nominal X",
    "Nom X;Nom Y\n0;0\n1;1\n": "has no measured X",
    HEAD + "0;0;0;0\n": "has a single hole",
    HEAD + "0;0;0;0\n0;0;0;0\n": "at different points",
    HEAD: "line 1: headings without rows",
    HEAD + "0;0;abc;0\n1;1;1;1\n": 'line 2: Meas X: "abc"; expected a number',
    HEAD + "0;0;0;0\n1;1;;1\n": "line 3: Meas X",
    HEAD + "0;0;0\n": 'line 2: "0;0;0": 3 cells; expected 4',
    HEAD + "0;0;nan;0\n1;1;1;1\n": "expected a number",
    HEAD + "0;0;0.1;0\n1;1;1,1;1\n": "one decimal sign",
    HEAD.replace("Nom X", "Nom X [mm]").replace("Nom Y", "Nom Y [inch]") + ROWS: "mixed units: mm",
    "unit mm\n" + HEAD.replace("Nom X", "Nom X [inch]") + ROWS: "mm (line 1) and in (line 2)",
    "Unit: furlong\n" + HEAD + ROWS: 'line 1: unit "furlong"; expected mm or inch',
    HEAD.replace("\n", ";Temp\n") + "0;0;0;0;20\n1;1;1;1;20\n": 'unknown heading "Temp"',
    "X;" + HEAD + "0;0;0;0;0\n1;1;1;1;1\n": 'unknown heading "X"',
    "Nom X;" + HEAD + "0;0;0;0;0\n1;1;1;1;1\n": 'heading "Nom X" twice',
    "Nom X;Nom Y;Meas X;Meas Y;Err X\n0;0;0.010;0;-0.010\n1;0;1;0;0\n": "nominal = 0.01 mm",
    "Nom X;Nom Y;Err X;Err Y\n0;0;400;0\n1;0;0;0\n": "deviation of X 400 mm; expected at",
    HEAD.replace("\n", ";U\n") + "0;0;0;0;3\n1;1;1;1;3\n": "with its unit, such as U95 [µm]",
    HEAD.replace("\n", ";U [µm]\n") + "0;0;0;0;0\n1;1;1;1;3\n": "uncertainty 0 µm",
    "Nom X;Nom Y;Dev X;Dev Y;Dev Z\n0;0;0;0;0\n1;1;0;0;0\n": "has no nominal Z",
    "x;y\n1;2\n": "has no coordinates X and Y",
}


@pytest.mark.parametrize(("text", "problem"), REFUSED.items(), ids=REFUSED.values())
def test_what_is_not_understood_is_refused_with_its_line(text, problem):
    with pytest.raises(SceneError) as refused:
        parse_report(text, "r.txt")
    assert problem in str(refused.value)
    assert str(refused.value).startswith("r.txt: ")


def test_a_spreadsheet_is_a_table(tmp_path):
    """A sheet with inline strings and numbers, written here cell by cell."""
    pytest.importorskip("python_calamine")
    rows = [HEAD.strip().split(";"), *([*map(float, row.split(";"))] for row in ROWS.split())]
    (tmp_path / "report.xlsx").write_bytes(xlsx(rows))
    report = load_report(tmp_path / "report.xlsx")
    np.testing.assert_allclose(1e3 * report.deviation_mm, READ_UM, atol=1e-9)


def test_a_damaged_spreadsheet_is_refused_whichever_byte_is_wrong(tmp_path):
    pytest.importorskip("python_calamine")
    rows = [HEAD.strip().split(";"), *([*map(float, row.split(";"))] for row in ROWS.split())]
    content, path, refused = xlsx(rows), tmp_path / "report.xlsx", 0
    for at in range(4, len(content)):
        path.write_bytes(content[:at] + bytes([content[at] ^ 0xFE]) + content[at + 1 :])
        try:
            load_report(path)
        except SceneError:
            refused += 1
    assert refused > len(content) / 2


def test_the_layout_of_the_measuring_shop_is_read():
    holes = layout()
    actual = holes + np.array([0.1, -0.05])
    report = parse_report(report_text(holes, actual), "r.txt")
    np.testing.assert_allclose(report.deviation_mm, actual - holes, atol=1e-9)
    np.testing.assert_allclose(report.diameter_mm, np.tile([2.167, 0.007], (82, 1)), atol=1e-9)


@pytest.mark.parametrize("turn", [4e-4, 0.3])
def test_a_planted_affine_part_is_recovered_whatever_its_placement(turn):
    """Scales and squareness in closed form; the turn is removed in full where it is large."""
    holes, (sx, sy, q) = layout(40), (12e-6, -7e-6, 25e-6)
    x, y = holes.T
    own = np.column_stack([x * (1 + sx) - q * y, y * (1 + sy)])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    text = report_text(holes, own @ rotation.T + [3.0, -2.0], digits=9)
    text = text if turn < 0.1 else text.replace("Err", "Tol")  # beyond the limit of deviations
    report = parse_report(text, "r.txt")
    deviation, placement = align(report)
    shape = PartShape(report.nominal_mm, 2)
    values = 1e3 * shape.inverses[1] @ deviation.ravel()
    second_order = 0.5e6 * turn**2 * (turn < 1e-3)
    np.testing.assert_allclose(values, [12 - second_order, -7 - second_order, 25], atol=0.02)
    assert (turn > 1e-3) == bool(np.abs(placement - np.eye(4)).max())
    # independent: the angle between the images of the axes of the plate
    matrix = np.linalg.lstsq(np.column_stack([holes, np.ones(40)]), own, rcond=None)[0][:2].T
    cosine = matrix[:, 0] @ matrix[:, 1] / np.prod(np.linalg.norm(matrix, axis=0))
    assert 1e6 * (np.arccos(cosine) - np.pi / 2) == pytest.approx(25, abs=0.01)


def test_a_row_of_holes_has_no_squareness():
    report = parse_report(HEAD + "0;0;0;0\n100;0;100;0\n200;0;200.002;0\n", "r.txt")
    assert [*PartShape(report.nominal_mm, 2).is_estimable] == [True, False, False]


UNCERTAIN = """title = "uncertain"
machine = "gantry_mill"
[errors]
EC0Y = 20.0
[uncertainty]
EC0Y = 1.5
"""


def compared(scene, text, **options):
    options = {"place": (0.0, 0.0, 0.0)} | options
    return Part(report=parse_report(text, "r.txt"), **options).run(scene, ignore_progress)


def test_a_squareness_of_the_machine_is_that_of_the_part_with_its_uncertainty():
    """γ of Y to X moves a hole by −γ·y: the angle becomes wider by γ; u = 1.5 µrad, k = 2."""
    holes = layout(30)
    scene = parse_scene(UNCERTAIN, "x.toml")
    rows = compared(scene, report_text(holes, holes), u95_um=4.0).measured
    square = next(row for row in rows if row.measure == "squareness")
    assert (square.name, square.unit) == ("part", "µrad")
    assert square.predicted_um == pytest.approx(20.0, abs=1e-6)
    assert square.u95_predicted_um == pytest.approx(3.0, abs=1e-6)
    arm = 1e-3 * np.column_stack([holes, np.ones(30)])
    design = np.zeros((60, 6))  # x' = a x + b y + c, y' = d x + e y + f; squareness −(b + d)
    design[0::2, :3] = design[1::2, 3:] = arm
    solution = np.linalg.pinv(design)
    expected = 4.0 * np.linalg.norm(-(solution[1] + solution[3]))
    assert square.u95_measured_um == pytest.approx(expected, rel=1e-6)
    assert square.en == pytest.approx(-20.0 / np.hypot(3.0, expected), abs=1e-6)
    wider = compared(scene, report_text(holes, holes), u95_um=4.0, session_u=2.0).measured
    between = next(row for row in wider if row.measure == "squareness").u95_predicted_um
    assert between == pytest.approx(5.0, abs=1e-6)  # √(3² + 4²)


def test_an_unknown_uncertainty_leaves_no_en():
    holes = layout(10)
    certain = compared(parse_scene(UNCERTAIN, "x.toml"), report_text(holes, holes))
    unknown = compared(
        scene_with("machine_gantry_mill", EC0Y=20.0), report_text(holes, holes), u95_um=1
    )
    assert {row.en for row in (*certain.measured, *unknown.measured)} == {None}
    assert {row.u95_measured_um for row in certain.measured} == {None}
    assert any("an uncertainty is unknown" in str(block) for block in certain.blocks())


def test_a_placed_plate_is_drilled_where_it_stands():
    """A scale of X of a plate turned by 90° is a scale of its Y."""
    scene, holes = scene_with("machine_gantry_mill"), layout(20)
    span = scene.axis_span("X")
    scene = scene_with("machine_gantry_mill", EXX=("ramp", 10e-3 * (span[1] - span[0])))
    result = compared(scene, report_text(holes, holes), place=(0.0, 0.0, 0.0, 0.0, 0.0, 90.0))
    values = {row.measure: row.predicted_um for row in result.measured if row.name == "part"}
    assert values == pytest.approx({"scale x": 0.0, "scale y": 10.0, "squareness": 0.0}, abs=1e-6)


def bored_plate(centres):
    solids = [
        trimesh.creation.cylinder(8.0, 60.0, 64).apply_translation([*at, 10.0]) for at in centres
    ]
    box = trimesh.creation.box([300.0, 200.0, 20.0]).apply_translation([0.0, 0.0, 10.0])
    mesh = trimesh.boolean.difference([box, *solids])
    return load_workpiece("plate.ply", "mm", mesh.export(file_type="ply"))


CENTRES = [(-100.0, -60.0), (100.0, -60.0), (-100.0, 60.0), (100.0, 60.0)]


def bored_text(centres=CENTRES, grown=0.004):
    head = "Feature;Nom X;Nom Y;Act X;Act Y;Nom D;Act D\n"
    return head + "".join(
        f"B{x:g}/{y:g};{x};{y};{x + 0.01};{y};16;{16 + grown}\n" for x, y in centres
    )


def test_holes_of_a_mesh_are_its_features():
    """The bores follow the machine: the same numbers as by points, and diameters as drilled."""
    pytest.importorskip("manifold3d")
    scene, mesh = parse_scene(UNCERTAIN, "x.toml"), bored_plate(CENTRES)
    bores = compared(scene, bored_text(), mesh=mesh, u95_um=2.0).comparison.measured
    points = compared(scene, bored_text(), u95_um=2.0).measured
    by_name = {(row.name, row.measure): row for row in bores}
    for row in points:
        other = by_name[row.name, row.measure]
        assert other.predicted_um == pytest.approx(row.predicted_um, abs=0.05)
        assert other.measured_um == pytest.approx(row.measured_um, abs=1e-9)
        assert other.u95_predicted_um == pytest.approx(row.u95_predicted_um, abs=0.02)
    diameters = [row for row in bores if row.measure == "diameter"]
    assert [row.measured_um for row in diameters] == pytest.approx([4.0] * 4)
    assert max(abs(row.predicted_um) for row in diameters) < 0.1  # a shear does not change it
    with pytest.raises(
        SceneError, match=r"line 2: B0/0 at 0, 0 mm is no feature.*outside the part"
    ):
        compared(scene, bored_text([(0, 0), *CENTRES]), mesh=mesh)


def run(*arguments):
    return CliRunner().invoke(guarded(command_of(Part)), [*map(str, arguments)])


@pytest.fixture
def files(tmp_path):
    holes, rng = layout(20), np.random.default_rng(3)
    read = measured(holes, rng)
    (tmp_path / "plate.txt").write_text(report_text(holes, read), "utf-8")
    head = "Hole;Nom X;Nom Y\n"
    rows = "".join(f"hole {at};{x};{y}\n" for at, (x, y) in enumerate(holes, 1))
    (tmp_path / "nominal.csv").write_text(head + rows, "utf-8")
    (tmp_path / "scene.toml").write_text(UNCERTAIN, "utf-8")
    return tmp_path


def test_a_prediction_is_sealed_before_and_verified_after(files):
    scene, seal = files / "scene.toml", files / "seal.json"
    shared = [scene, "--place", "0,0,0", "--seal", seal, "--json"]
    before = run(*shared, "--measured", files / "nominal.csv")
    assert before.exit_code == 0, before.output
    document = json.loads(before.stdout)
    assert document["seal"]["state"] == "written"
    assert {row["measured_um"] for row in document["measured"]} == {None}
    content = seal.read_text("utf-8")
    after = json.loads(run(*shared, "--measured", files / "plate.txt").stdout)
    assert after["seal"] == {**document["seal"], "state": "verified"}
    assert {row["en"] is None for row in after["measured"]} == {True}
    scene.write_text(UNCERTAIN.replace("20.0", "21.0"), "utf-8")
    changed = run(*shared[:-1], "--measured", files / "plate.txt")
    assert "seal different" in changed.stdout
    assert "predictions differ; first hole 1 x" in changed.stderr
    assert seal.read_text("utf-8") == content
    seal.write_text(content.replace('"uncertain"', '"certain"'), "utf-8")
    altered = json.loads(run(*shared, "--measured", files / "plate.txt").stdout)
    assert altered["seal"]["state"] == "altered"


def test_a_seal_does_not_depend_on_machine_and_date(tmp_path):
    """SHA-256 of a fixed prediction, computed once by hand of the canonical text."""
    import hashlib

    scene = load_scene("teach_squareness")
    seal = seal_prediction(str(tmp_path / "seal.json"), scene, (0.0,) * 6, [])
    canonical = (
        '{"columns":["measurand","unit","predicted","u95_predicted"],"place":[0.0,0.0,0.0,0.0,0.0,0.0],'
        f'"predicted":[],"scene":"{scene.title}"}}'
    )
    assert seal.sha256 == hashlib.sha256(canonical.encode()).hexdigest()


def test_what_is_no_seal_is_refused_and_kept(files):
    other = files / "other.json"
    other.write_text("[]", "utf-8")
    said = run(files / "scene.toml", files / "plate.txt", "--seal", other)
    assert isinstance(said.exception, WarpspaceError)
    assert "is no sealed prediction" in str(said.exception)
    assert other.read_text("utf-8") == "[]"


def test_the_features_of_a_mesh_are_sealed_before_and_verified_after(tmp_path):
    seal = tmp_path / "seal.json"
    before = run("part_on_dvf5000", "--seal", seal, "--json")
    assert before.exit_code == 0, before.output
    document = json.loads(before.stdout)
    sealed = {row[0]: row[2] for row in json.loads(seal.read_text("utf-8"))["predicted"]}
    for feature in document["features"]:
        for measure, numbers in feature["measures"].items():
            value = numbers.get("placed_difference_um", numbers.get("placed_difference_urad"))
            assert sealed.pop(f"{feature['name']} {measure}") == pytest.approx(value, abs=5e-5)
    assert not sealed
    assert document["seal"]["state"] == "written"
    after = json.loads(run("part_on_dvf5000", "--seal", seal, "--json").stdout)
    assert after["seal"] == {**document["seal"], "state": "verified"}
    moved = run("part_on_dvf5000", "--seal", seal, "--place", "10,0,50")
    assert "seal different" in moved.stdout
    assert "place: " in moved.stderr


def test_a_report_alone_is_compared_although_the_scene_has_a_part(files):
    scene = replace(load_scene("part_on_dvf5000"), title="x")
    text = (files / "plate.txt").read_text("utf-8")
    (files / "small.txt").write_text(text, "utf-8")
    result = Part(file=str(files / "small.txt"), place=(0.0, 0.0, 0.0)).run(scene, ignore_progress)
    assert len(result.measured) == 43
    with pytest.raises(SceneError, match="outside the part"):
        Part(measured=str(files / "small.txt")).run(scene, ignore_progress)


def test_bundled_plates_are_those_that_are_simulated():
    folder = assets_dir() / "measurements" / "simulated_plates"
    for name, text in bundled_plates().items():
        assert (folder / name).read_bytes().decode() == text
