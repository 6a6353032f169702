"""Pictures and interactive scenes of the gallery.

Every example writes a file whose name it is given. The gallery names one in its own folder, and
shows what was written: a picture as it is, of an animation its first frame too, of a PDF its first
page, of a GLB what it holds. Beside it stands the scene of the example as an offline page.
"""

import re
import shutil
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
EXTRA = HERE / "_build" / "extra"
"""Copied to the top of the site as it is."""
WRITTEN = HERE / "_build" / "examples"

ORDER = (
    "error_map",
    "error_map_component",
    "slices",
    "orientation_map",
    "comparison",
    "machine",
    "traces",
    "rotary",
    "error_curves",
    "gains",
    "montecarlo",
    "adjust",
    "ballbar",
    "concepts",
    "acceptance",
    "animation",
    "own_plotter",
    "exports",
    "design_review",
)
"""What comes first in the gallery; other examples follow in the order of their names."""
TOOLS = ("convention_drawings", "screenshots", "thumbnails")
"""Scripts beside the examples that take the pictures of the pages."""
FRAME_PX = 560

TABS = """
.. tab-set::

   .. tab-item:: {name}

      .. image-sg:: /{image}
         :alt: {alt}
         :srcset: /{image}
         :class: sphx-glr-single-img

   .. tab-item:: Interactive scene

      .. raw:: html

         <iframe class="scene" loading="lazy" src="../scenes/{scene}.html"
          title="{scene}: drag to turn, wheel to zoom" height="{height}"></iframe>
         <p><a class="scene" href="../scenes/{scene}.html">{scene} on a page of its own</a></p>

"""
ALONE = """
.. image-sg:: /{image}
   :alt: {alt}
   :srcset: /{image}
   :class: sphx-glr-single-img

"""


class InGalleryOrder:
    """Sorts the examples of the gallery; sphinx-gallery gives it the folder."""

    def __init__(self, src_dir: str) -> None:
        self.src_dir = src_dir

    def __call__(self, filename: str) -> tuple[int, str]:
        """Give the key an example is sorted by."""
        name = Path(filename).stem
        return (ORDER.index(name) if name in ORDER else len(ORDER), name)


def target_argument(_: dict[str, Any], script_vars: dict[str, Any]) -> list[str]:
    """Name the file or folder that an example writes to.

    Returns
    -------
    list of str
        The arguments of the script: a folder where its docstring says FOLDER, else a picture.
    """
    script = Path(script_vars["src_file"])
    folder = WRITTEN / script.stem
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    takes_folder = "[FOLDER]" in script.read_text("utf-8")
    return [str(folder if takes_folder else folder / f"{script.stem}.png")]


def add_pictures(
    _: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any], **__: Any
) -> str:
    """Show what an example has written, and its scene.

    Returns
    -------
    str
        reStructuredText; empty where nothing new was written.
    """
    script = Path(block_vars["src_file"])
    written = sorted(p for p in (WRITTEN / script.stem).glob("*") if p.suffix in _DRAW)
    if not written:
        return ""
    source = written[0]
    picture = Path(next(block_vars["image_path_iterator"]))
    _DRAW[source.suffix](source, picture)
    shown = picture
    if source.suffix == ".webp":  # it moves
        shown = picture.with_suffix(".webp")
        shutil.copyfile(source, shown)
    scene = _write_scene(script, block_vars["example_globals"])
    source.unlink()
    image = shown.relative_to(gallery_conf["src_dir"]).as_posix()
    alt = f"what {script.name} draws"
    if scene is None:
        return ALONE.format(image=image, alt=alt)
    name = {".webp": "Animation", ".pdf": "First page", ".glb": "GLB"}.get(source.suffix, "Picture")
    return TABS.format(image=image, alt=alt, name=name, scene=scene, height=FRAME_PX)


def _write_scene(script: Path, names: dict[str, Any]) -> str | None:
    """Write the first scene of an example as an offline page, once per scene."""
    from warpspace import load_scene
    from warpspace.cli.services import write_page
    from warpspace.picture.model import evaluate_picture

    loaded = re.findall(r'load_scene\("(\w+)"\)|\("(dvf5000_\w+)"', script.read_text("utf-8"))
    if loaded:
        name = "".join(loaded[0])
        scene = load_scene(name)
    elif names.get("scenes"):
        name, scene = script.stem, names["scenes"][0]
    else:
        return None
    page = EXTRA / "scenes" / f"{name}.html"
    if not page.exists():
        page.parent.mkdir(parents=True, exist_ok=True)
        picture = evaluate_picture(scene, exaggeration="auto", grid=21, loop="tool")
        write_page(picture, page, overwrite=True)
    return name


def _copy(source: Path, picture: Path) -> None:
    shutil.copyfile(source, picture)


def _first_frame(source: Path, picture: Path) -> None:
    from PIL import Image

    with Image.open(source) as frames:
        frames.seek(getattr(frames, "n_frames", 1) // 2)
        frames.convert("RGB").save(picture)


def _first_page(source: Path, picture: Path) -> None:
    import pypdfium2

    document = pypdfium2.PdfDocument(source)
    document[0].render(scale=1.6).to_pil().save(picture)
    document.close()


def _render(source: Path, picture: Path) -> None:
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(1200, 900))
    plotter.import_gltf(str(source))
    plotter.set_background("white")
    plotter.camera_position = [(-1.0, 0.8, 1.4), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    plotter.reset_camera()
    plotter.camera.zoom(1.3)
    plotter.screenshot(picture)
    plotter.close()


_DRAW = {
    ".png": _copy,
    ".webp": _first_frame,
    ".gif": _first_frame,
    ".pdf": _first_page,
    ".glb": _render,
}
