"""The files of a compensation as one download."""

import io
import zipfile

from warpspace.formats.compensation.compensate import Compensation

STEM = "compensation"
DATE = (1980, 1, 1, 0, 0, 0)
"""The same table gives the same bytes."""


def packed(found: Compensation) -> tuple[str, bytes]:
    """Give name and content of what is saved: the file of the table, or a ZIP of several.

    Parameters
    ----------
    found : Compensation

    Returns
    -------
    str
    bytes
    """
    ending = found.format.endings[0]
    files = {f"{STEM}{add or ending}": text.encode("utf-8") for add, text in found.files.items()}
    if len(files) == 1:
        return next(iter(files.items()))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, content in files.items():
            bundle.writestr(zipfile.ZipInfo(name, DATE), content, zipfile.ZIP_DEFLATED)
    return f"{STEM}.zip", buffer.getvalue()
