"""Covariances in scene files: what they keep, and what is refused by key and value."""

import math
import re
from dataclasses import replace
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import pytest

from warpspace.analysis.uncertainty.propagation import scene_uncertainty
from warpspace.exceptions import SceneError
from warpspace.machine.errors import Covariance
from warpspace.scene.library import load_scene, parse_scene
from warpspace.scene.scene_writer import Notation, scene_files, scene_to_toml

SCENE = """[machine]
chain = "wFXYZt"
[workspace]
X = [-100, 100]
Y = [-100, 100]
Z = [-50, 50]
[errors]
EC0Y = 20
EA0Z = -30
[uncertainty.covariance]
keys = ["EC0Y", "EA0Z"]
matrix = [[4.0], [3.0, 9.0]]
"""
SAID = "expected a file of numpy with the arrays keys and matrix"
WHOLE = Covariance(
    ("EC0Y", "EA0Z"),
    ((4.0, 3.0), (3.0, 9.0)),
    12.0,
    {"X": (-10.0, 20.0), "Z": (5.0, 5.0)},
    ("EXX", "EYY"),
    61.9,
)


def test_all_that_a_covariance_says_comes_back_from_its_text():
    scene = replace(parse_scene(SCENE, "s"), covariance=WHOLE)
    text = scene_to_toml(scene)
    assert "Z = 5.0" in text
    assert parse_scene(text, "s").covariance == WHOLE
    nothing = Covariance((), (), undetermined=("EXX",))
    back = parse_scene(scene_to_toml(replace(scene, covariance=nothing)), "s")
    assert back.covariance == nothing
    assert scene_uncertainty(back).unknown == ("EC0Y", "EA0Z", "EXX")


def test_what_is_left_open_is_unknown_also_where_its_value_is_zero():
    doubt = scene_uncertainty(replace(parse_scene(SCENE, "s"), covariance=WHOLE))
    assert (doubt.unknown, doubt.is_known) == (("EXX", "EYY"), False)
    assert not replace(doubt, unknown=()).is_known  # as an app does that counts again
    said = " ".join(doubt.remarks())
    assert "not estimable from the readings: EXX, EYY; what depends on them shows “± ?”" in said
    assert "61.9 times the scatter of its readings; U95 does not include that" in said
    assert "not stated" not in said
    known = scene_uncertainty(parse_scene(SCENE, "s"))
    assert (known.is_known, [*known.remarks()]) == (True, [])


def test_a_covariance_is_written_in_the_sign_of_its_squareness():
    """A turn of Y about z opens the angle to X, a turn of Z about y closes it: right-hand rule."""
    scene = parse_scene(SCENE.replace("EA0Z", "EB0Z"), "s")
    text = scene_to_toml(scene, Notation("over_90"))
    assert "matrix = [[4.0], [-3.0, 9.0]]" in text
    assert "EB0Z = 30.0" in text
    assert parse_scene(text, "s").covariance == scene.covariance
    moved = SCENE + "[convention]\nmeasuring_line_mm = { X = [0, 0, 100] }\n"
    with pytest.raises(SceneError, match=r"would move the errors of \[uncertainty\]"):
        parse_scene(moved, "s")


def test_errors_that_are_found_anew_leave_the_others():
    left = WHOLE.without(("EC0Y", "EYY"))
    assert left == replace(WHOLE, keys=("EA0Z",), rows=((9.0,),), undetermined=("EXX",))


def test_an_axis_that_stood_still_was_measured_nowhere_else():
    at = {"X": np.array([0.0, 0.0, 21.0, 20.0]), "Z": np.array([5.0, 5.1, 5.0, 5.0 + 1e-9])}
    assert WHOLE.outside(at, (4,)).tolist() == [False, True, True, False]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        # large entries beside small ones: compared in units of the uncertainties
        (
            "[[4.0], [3.0, 9.0]]",
            "[[1e-4, 0.005], [-0.005, 1e6]]",
            r"matrix\[0\]\[1\] = 0.005: is not symmetric; expected -0.005 as in \[1\]\[0\]",
        ),
        ("[[4.0], [3.0, 9.0]]", "[[4.0], [3.0, -9.0]]", r"matrix\[1\]\[1\] = -9.0: .*EA0Z"),
        ("[[4.0], [3.0, 9.0]]", "[[4.0], [7.0, 9.0]]", r"matrix\[[01]\] = .*E[CA]0[YZ] and others"),
        ('"EC0Y", "EA0Z"]', '"EC0X", "EA0Z"]', 'keys = "EC0X": is zero by definition'),
        ("matrix", 'undetermined = ["EC0X"]\nmatrix', 'keys = "EC0X": is zero by definition'),
        ("matrix", 'undetermined = ["EA0Z"]\nmatrix', 'keys = "EA0Z": expected each error once'),
        ("matrix", 'undetermined = ["EA0Q"]\nmatrix', "EA0Q: unknown error parameter"),
        ("matrix", "lack_of_fit = -1\nmatrix", "lack_of_fit = -1: expected at least 0"),
        (
            "matrix",
            "measured_range = { X = [5, 4] }\nmatrix",
            r"measured_range.X = \[5, 4\]: expected",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_row_and_value(old, new, said):
    with pytest.raises(SceneError, match=said):
        parse_scene(SCENE.replace(old, new), "s")


@pytest.mark.parametrize(("curve", "value"), [("0", "0"), ("-1", "-1"),
    ("{ table = [[-100, 0.5], [0, 0], [100, 1]] }", "0.0")])  # fmt: skip
def test_an_uncertainty_is_above_zero_at_every_position(curve, value):
    text = SCENE.replace("[uncertainty.", f"[uncertainty]\nEXX = {curve}\n[uncertainty.")
    with pytest.raises(
        SceneError, match=rf"uncertainty.EXX = {value}.*: expected a number above 0"
    ):
        parse_scene(text, "s")


def test_a_large_covariance_stands_beside_its_scene(tmp_path):
    scene = parse_scene("machine = 'dvf5000'\n" + SCENE[SCENE.index("[workspace]") :], "s")
    keys = scene.parameter_keys[:31]
    root = np.random.default_rng(1).standard_normal((31, 31))
    rows = tuple(map(tuple, (root @ root.T).tolist()))
    scene = replace(scene, covariance=replace(WHOLE, keys=keys, rows=rows, undetermined=()))
    for add, content in scene_files(scene, "large").items():
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / f"large{add or '.toml'}").write_bytes(data)
    assert load_scene(tmp_path / "large.toml").covariance == scene.covariance
    whole = (tmp_path / "large.npz").read_bytes()
    other = replace(scene, covariance=replace(scene.covariance, rows=np.diag([4.0] * 31).tolist()))
    (tmp_path / "large.npz").write_bytes(scene_files(other, "large")[".npz"])
    with pytest.raises(SceneError, match=r'matrix = "large\.npz": is not the matrix of this scene'):
        load_scene(tmp_path / "large.toml")
    text = (tmp_path / "large.toml").read_text("utf-8")
    (tmp_path / "old.toml").write_text(re.sub("sha256 = .*?, ", "", text), encoding="utf-8")
    assert load_scene(tmp_path / "old.toml").covariance.matrix[0, 0] == 4.0
    (tmp_path / "large.npz").write_bytes(whole)
    assert load_scene(tmp_path / "large.toml").covariance == scene.covariance
    (tmp_path / "large.npz").unlink()
    with pytest.raises(SceneError, match=r"large\.npz"):
        load_scene(tmp_path / "large.toml")
    assert [*scene_files(parse_scene(SCENE, "s"), "small")] == [""]


def packed(path, **files):
    with ZipFile(path, "w", ZIP_DEFLATED) as pack:
        for name, content in files.items():
            pack.writestr(f"{name}.npy", content)


def array_header(**changes):
    head = BytesIO()
    usual = {"descr": "<f8", "fortran_order": False, "shape": (2, 2)}
    np.lib.format.write_array_header_1_0(head, usual | changes)
    return head.getvalue()


def enormous(path):
    head = array_header(shape=(10**6, 10**6))
    packed(path, keys=head, matrix=head)


def damaged(path):
    np.savez_compressed(
        path, keys=np.array(["EC0Y"]), matrix=np.random.default_rng(0).random((60, 60))
    )
    content = bytearray(path.read_bytes())
    at = content.find(b"matrix.npy") + 200
    content[at : at + 60] = b"\xff" * 60
    path.write_bytes(content)


def locked(path):
    np.savez(path, keys=np.array(["EC0Y"]), matrix=[[1.0]])
    content = bytearray(path.read_bytes())
    for mark, flag in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        for at in range(len(content)):
            if content.startswith(mark, at):
                content[at + flag] |= 1
    path.write_bytes(content)


def header(path, **changes):
    keys = BytesIO()
    np.save(keys, np.array(["EC0Y", "EA0Z"]))
    packed(path, keys=keys.getvalue(), matrix=array_header(**changes) + np.eye(2).tobytes())


def raw_header(path, text):
    text = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text
    packed(path, keys=text, matrix=text)


UNREADABLE = {
    "plain bytes": lambda path: packed(path, keys=b"hello", matrix=b"world"),
    "enormous": enormous,
    "damaged": damaged,
    "locked": locked,
    "without bytes": lambda path: header(path, descr="|V0", shape=(10**7,)),
    "entries without bytes": lambda path: header(path, descr="|V0"),
    "texts": lambda path: header(path, descr="<U2"),
    "deep header": lambda path: raw_header(path, b"[" * 9000),
    "unfinished header": lambda path: raw_header(path, b"{'descr': '<f8', 'shape': (2, 2"),
    "other arrays": lambda path: np.savez(path, keys=["EC0Y"], matrix=[[1.0]], more=np.zeros(10)),
}


@pytest.mark.parametrize("write", UNREADABLE.values(), ids=UNREADABLE)
def test_a_file_of_numpy_that_cannot_be_read_is_named(tmp_path, write):
    write(tmp_path / "c.npz")
    text = SCENE[: SCENE.index("[uncertainty.")] + '[uncertainty]\ncovariance = "c.npz"\n'
    (tmp_path / "s.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as error:
        load_scene(tmp_path / "s.toml")
    assert str(error.value).endswith(SAID)


def test_degrees_of_freedom_that_are_not_given_are_infinite():
    assert parse_scene(SCENE, "s").covariance.dof == math.inf
