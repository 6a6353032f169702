"""Files of a page are parsed beside its session, one after the other."""

import threading

import pytest

from app.hostile import upload
from app.wire import opened
from warpspace.app.browser import actions as do
from warpspace.app.panels import upload_panels
from warpspace.exceptions import OptionError
from warpspace.resources import assets_dir, scenes_dir
from warpspace.scene.library import load_scene

STL = (scenes_dir() / "parts" / "contour.stl").read_bytes()


@pytest.fixture
def held(monkeypatch):
    """Have a mesh parsed once an event is set; give that, and the names of the files so far."""
    go_on, begun, original = threading.Event(), [], upload_panels.load_workpiece

    def load(name, unit, content):
        begun.append(name)
        assert go_on.wait(60.0)
        if name == "bad.stl":
            raise OptionError("bad.stl: expected triangles")
        return original(name, unit, content)

    monkeypatch.setattr(upload_panels, "load_workpiece", load)
    yield go_on, begun
    go_on.set()


def send(wire, name):
    wire.say(upload(name, STL, "part"))


def test_a_tab_goes_on_while_its_files_are_parsed_in_order(held):
    go_on, begun = held
    with opened(load_scene("dvf5000_first")) as (wire, session):
        for name in ("bad.stl", "good.stl"):
            send(wire, name)
        assert wire.read_until(lambda: bool(begun))
        wire.say(do.SetError("EXX", "3"))
        assert wire.read_until(lambda: 'data-text="3"' in wire.pieces["error.EXX"])
        assert (begun, session.state.part.mesh) == (["bad.stl"], None)
        go_on.set()
        assert wire.read_until(lambda: session.state.part.mesh is not None)
        assert begun == ["bad.stl", "good.stl"]


def test_the_error_of_a_file_stands_in_its_section(held):
    go_on, _ = held
    go_on.set()
    with opened(load_scene("part_on_dvf5000")) as (wire, _):
        wire.say(do.SetLeaf("page.task", "measure"))
        wire.say(do.Input.FOLD_SECTION("part"))
        send(wire, "bad.stl")
        assert wire.read_until(lambda: "bad.stl: expected triangles" in str(wire.pieces))


def test_a_file_that_is_parsed_when_its_tab_closes_is_not_taken_in(held):
    go_on, begun = held
    with opened(load_scene("dvf5000_first")) as (wire, session):
        send(wire, "good.stl")
        assert wire.read_until(lambda: bool(begun))
        (job,) = [job for job in session.context.jobs if job.name == "Reading"]
        session.stop()
        assert job.is_set()
        go_on.set()
    assert session.state.part.mesh is None


def test_a_dropped_inspection_report_opens_the_part_with_the_comparison():
    """It is recognised by its content; without a mesh its holes are the part."""
    content = (assets_dir() / "measurements" / "simulated_plates" / "plate_1.txt").read_bytes()
    with opened(load_scene("dvf5000_nominal")) as (wire, session):
        wire.say(upload("CMM 17.txt", content))
        assert wire.read_until(lambda: "part squareness" in str(wire.pieces), 60.0)
        assert session.state.page.task == "measure"
        assert "CMM_17.txt, 60 holes" in str(wire.pieces) or "CMM 17.txt, 60 holes" in str(
            wire.pieces
        )
        bad = content.replace(b"   2.167", b"   2,167", 1)
        wire.say(upload("bad.txt", bad))
        assert wire.read_until(lambda: "expected one decimal sign" in str(wire.pieces), 60.0)
