"""A figure and an export format of a plug-in appear wherever those of warpspace do."""

import io
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from cli.conftest import Command, warpspace
from warpspace.cli.services import build_services, write_export
from warpspace.outputs.drawing.content import Drawing
from warpspace.outputs.drawing.settings import FigureSettings
from warpspace.outputs.drawing.sheet import metadata
from warpspace.outputs.exports.formats import (
    ExportFormat,
    export_formats,
    register_format,
    unregister_format,
)
from warpspace.outputs.figures.catalogue import (
    FigureKind,
    draw_figure,
    figure_names,
    register_figure,
    unregister_figure,
)
from warpspace.outputs.report.build import build_report
from warpspace.outputs.report.review import ReportSettings
from warpspace.outputs.worker import FigureWorker
from warpspace.picture.scene_picture import ScenePicture, evaluate_picture
from warpspace.scene.library import load_scene
from warpspace.scene.model import Scene

__all__ = ["warpspace"]


def draw_names(scenes: Sequence[Scene], settings: FigureSettings, *, exact: bool) -> Drawing:
    title = f"Names of the errors: {scenes[0].title}"
    figure = Figure(figsize=(4.0, 3.0))
    figure.text(0.1, 0.5, " ".join(scenes[0].errors))
    return Drawing(figure, title, metadata(title, scenes, settings, 1.0, "names"))


@pytest.fixture
def names_figure() -> Iterator[str]:
    register_figure(FigureKind("names", "Names of the errors.", draw_names, evidence=True))
    yield "names"
    unregister_figure("names")


def write_zip(picture: ScenePicture, path: Path, *, overwrite: bool = True) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mean.txt", f"{picture.statistics.mean_um:.6f}")


@pytest.fixture
def zip_format() -> Iterator[str]:
    register_format(ExportFormat(".zip", "the mean, packed", write_zip))
    yield ".zip"
    unregister_format(".zip")


def test_an_added_figure_is_drawn_and_listed(names_figure: str, warpspace: Command) -> None:
    scene = load_scene("dvf5000_first")
    assert names_figure in figure_names()
    drawing = draw_figure(names_figure, [scene])
    assert "EC0Y" in drawing.figure.texts[0].get_text()
    assert (names_figure, "Names of the errors.") in build_services().figures


def test_an_added_figure_stands_in_the_report(
    names_figure: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []

    def render(_self: FigureWorker, name: str, *_: object) -> bytes:
        drawn.append(name)
        return b"<svg/>"

    monkeypatch.setattr(FigureWorker, "render", render)
    report = build_report([load_scene("dvf5000_first")], ReportSettings(grid=3, samples=1000))
    assert names_figure in drawn
    assert "Names of the errors." in [picture.caption for picture in report.pictures]


def test_an_added_format_is_written_by_the_command_and_for_the_app(
    zip_format: str, warpspace: Command, tmp_path: Path
) -> None:
    assert zip_format in [form.ending for form in export_formats()]
    assert (zip_format, "the mean, packed") in build_services().exports
    target = tmp_path / "out.zip"
    result = warpspace("export", "dvf5000_first", "-o", target, "--grid", "3")
    assert result.status == 0, result.err
    wanted = f"{evaluate_picture(load_scene('dvf5000_first'), grid=3).statistics.mean_um:.6f}"
    assert zipfile.ZipFile(target).read("mean.txt").decode() == wanted


def test_the_app_gets_the_content_of_an_added_format(zip_format: str) -> None:
    from warpspace.app.documents.export_request import build_request
    from warpspace.app.evaluation.evaluate import LiveModel
    from warpspace.app.state.app_state import start_state

    picture = LiveModel().evaluate(start_state(load_scene("dvf5000_first"), nodes=3))
    content = write_export(build_request(picture), zip_format)
    found = float(zipfile.ZipFile(io.BytesIO(content)).read("mean.txt"))
    assert found == pytest.approx(picture.statistics.mean_um, abs=1e-6)
