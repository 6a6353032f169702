"""The documentation site is built without a warning, and its links lead somewhere."""

import os
import subprocess
import sys

import pytest

from doc_pages import DOCS

pytestmark = pytest.mark.nightly


def test_the_site_is_built_and_its_links_lead_somewhere(tmp_path):
    site = tmp_path / "html"
    quiet = {**os.environ, "OMP_NUM_THREADS": "1"}
    options = ["-b", "html", "-W", "--keep-going", "-q", "-d", tmp_path / "doctrees"]
    for command in (
        ["-m", "sphinx", *options, DOCS, site],
        [DOCS / "_ext" / "check_links.py", site],
    ):
        line = [sys.executable, *map(str, command)]
        process = subprocess.run(line, capture_output=True, text=True, check=False, env=quiet)
        assert process.returncode == 0, process.stdout[-3000:] + process.stderr[-3000:]
