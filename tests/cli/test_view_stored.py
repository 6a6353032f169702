"""A stored field opens as it was stored, and only if it is one."""

import re

import numpy as np
import pytest
from click.testing import CliRunner

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.cli.commands.view import _stored_start
from warpspace.cli.main import cli
from warpspace.exceptions import SceneError
from warpspace.outputs.exports import load_stored_field


def test_stored_field_is_shown_with_its_settings_and_its_errors(tmp_path):
    path = tmp_path / "field.vts"
    words = ["export", "teach_wobbling_table", "--loop", "relative", "--grid", "11"]
    assert CliRunner().invoke(cli, [*words, "-o", str(path)]).exit_code == 0
    state = _stored_start(str(path))
    assert (state.loop, state.nodes, state.notes) == ("relative", 11, ())
    stored = load_stored_field(path)
    assert state.exaggeration == stored.picture.exaggeration
    shown = LiveModel().evaluate(state).field.error_um
    np.testing.assert_allclose(shown, stored.field.error_um, atol=1e-12)


@pytest.mark.parametrize(
    ("found", "put"),
    [
        ('NumberOfComponents="3"', 'NumberOfComponents="437134864473"'),
        ('NumberOfTuples="1"', 'NumberOfTuples="99999999999"'),
        ('WholeExtent="0 2 0 2 0 2"', 'WholeExtent="0 2000000 0 2 0 2"'),
        ('WholeExtent="0 2 0 2 0 2"', 'WholeExtent="0 -2 0 2 0 2"'),
        ("AQAAAACAAAAIAAAA", "AQAtableAAACAAAA"),
        ("AQAAAACAAAAIAAAA", "/////wCAAAAIAAAA"),
        ("<StructuredGrid", "<StructuredGrid <"),
        ("<VTKFile", '<!DOCTYPE x [<!ENTITY a "b">]><VTKFile'),
    ],
)
def test_sizes_that_no_field_has_are_refused_before_vtk_reads_them(tmp_path, found, put):
    path = tmp_path / "field.vts"
    words = ["export", "dvf5000_first", "--grid", "3", "-o", str(path)]
    assert CliRunner().invoke(cli, words).exit_code == 0
    text, count = re.subn(re.escape(found), put, path.read_text("utf-8"), count=1)
    assert count == 1
    path.write_text(text, "utf-8")
    with pytest.raises(SceneError, match=r"is no VTK structured grid"):
        load_stored_field(path)
