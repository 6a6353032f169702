"""Files whose structure nobody has published: named, with what to export instead."""

from dataclasses import dataclass

from warpspace.exceptions import SceneError


@dataclass(frozen=True)
class Unknown:
    """A kind of file that cannot be read.

    Attributes
    ----------
    what : str
    instead : str
    endings : tuple of str
    starts : tuple of bytes
        What its files begin with.
    """

    what: str
    instead: str
    endings: tuple[str, ...] = ()
    starts: tuple[bytes, ...] = ()


UNKNOWN = (
    Unknown(
        "a spreadsheet",
        "save the sheet as CSV with the header of `warpspace template AXIS`",
        (".xlsx", ".xls", ".ods"),
        (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"),
    ),
    Unknown(
        "a PDF", "export the numbers as CSV from the program that wrote it", (".pdf",), (b"%PDF",)
    ),
    Unknown(
        "a capture of a laser interferometer whose structure is not published",
        "export the deviations as .rtl or as CSV",
        (".rtx", ".rtf", ".dyn", ".pos"),
    ),
    Unknown(
        "a SINUMERIK VCS file, whose structure is not published",
        "export the calibration in the Etalon exchange format (variant Vendor) or as CSV",
        (".vcs", ".vcs2"),
    ),
    Unknown(
        "a FANUC file of three-dimensional error compensation, whose structure is not published",
        "list its points in the table that docs/compensation.md shows under fanuc-3d",
        (".3de",),
    ),
    Unknown(
        "a HEIDENHAIN kinematics table",
        "export its .COM and .CMA files",
        (".tab", ".kinematics", ".knc"),
    ),
    Unknown(
        "an error map of a coordinate measuring machine, whose structure is not published",
        "export its error curves as CSV",
        (".vec", ".cmp", ".map"),
    ),
)
"""What is refused by name."""


def refuse_unknown(name: str, content: bytes) -> None:
    """Refuse a file of a structure that nobody has published.

    Parameters
    ----------
    name : str
        Of the file.
    content : bytes
        Its beginning at least.

    Raises
    ------
    SceneError
        Naming what it is and what to export instead.
    """
    lower = name.lower()
    for kind in UNKNOWN:
        if any(content.startswith(start) for start in kind.starts) or lower.endswith(kind.endings):
            raise SceneError(name, [f"is {kind.what}; expected another file: {kind.instead}"])
