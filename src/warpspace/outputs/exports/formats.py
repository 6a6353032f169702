"""Registry of the export formats; each is written by a module of this package."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from warpspace.exceptions import OptionError
from warpspace.plugins import Registry, load_plugins

if TYPE_CHECKING:
    from warpspace.picture.model import ScenePicture

Write = Callable[..., None]  # of a picture, a path and the keyword `overwrite`


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """A format of exports."""

    ending: str  # of its files, for instance ".glb"
    about: str  # its purpose, a few words: help of the command line, buttons of the app
    write: str | Write  # "module:function", imported when it is written, or the function itself
    in_app: bool = True  # offered by the app
    left_out: str = ""  # parts of a scene that it cannot hold; stated when it is written

    def load(self) -> Write:
        return resolve_name(self.write) if isinstance(self.write, str) else self.write


_PACKAGE = "warpspace.outputs.exports"
_FORMATS: Registry[ExportFormat] = Registry("export format", {}, key="ending")
export_formats, register_format = _FORMATS.members, _FORMATS.register
unregister_format = _FORMATS.unregister
for _form in (
    ExportFormat(".glb", "3-D viewers, CAD", f"{_PACKAGE}.meshes:write_glb"),
    ExportFormat(".vts", "ParaView", f"{_PACKAGE}.fields:write_vts"),
    ExportFormat(".csv", "the field", f"{_PACKAGE}.fields:write_csv"),
    ExportFormat(
        ".urdf",
        "robot simulators: joints, limits, meshes",
        f"{_PACKAGE}.urdf_export:write_urdf",
        in_app=False,
        left_out="a URDF file holds the nominal machine only: no errors, tolerances, conventions,"
        " gantries, working volume, functional points or view",
    ),
):
    register_format(_form)


def write_export(picture: "ScenePicture", path: Path, *, overwrite: bool = True) -> None:
    load_plugins()
    form = _FORMATS.get(path.suffix.lower())
    if form is None:
        raise OptionError(
            f"{path.name}: no export format {path.suffix!r}; expected one of {', '.join(_FORMATS)}"
        )
    form.load()(picture, path, overwrite=overwrite)
