"""A stored field opens as it was stored, and only if it is one."""

import numpy as np
from click.testing import CliRunner

from warpspace.app.evaluation.evaluate import LiveModel
from warpspace.cli.commands.view import _stored_start
from warpspace.cli.main import cli
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
