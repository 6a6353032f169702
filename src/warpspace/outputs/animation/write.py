"""Animations: pictures drawn in processes of their own, joined to a GIF, WebP or MP4."""

import io
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from warpspace import __version__
from warpspace.exceptions import OutputError, RenderError, WorkersLostError
from warpspace.outputs.animation.pictures import AnimationSettings, draw_frame
from warpspace.outputs.files import check_target, write_atomically
from warpspace.outputs.processes import ProcessPool
from warpspace.outputs.worker import probe_renderer
from warpspace.scene.model import Scene

ENDINGS = (".gif", ".webp", ".mp4")
MAX_WORKERS = 4
VIDEO_EXTRA = "pip install 'warpspace[video]'"
Progress = Callable[[int], object]


def write_animation(
    scene: Scene,
    path: str | Path,
    settings: AnimationSettings | None = None,
    *,
    overwrite: bool = True,
    progress: Progress | None = None,
) -> None:
    """Draw an animation of a scene into a file.

    Parameters
    ----------
    scene : Scene
    path : str or Path
        Ends in .gif, .webp or .mp4.
    settings : AnimationSettings, optional
    overwrite : bool, optional
        Whether an existing file may be replaced.
    progress : callable, optional
        Called with 1 for every picture that is done.

    Raises
    ------
    OutputError
        If the file cannot be written, or the package that writes MP4 is missing.
    RenderError
        If the renderer crashed.
    OptionError
        If the scene has nothing that could move like that.
    """
    settings = settings or AnimationSettings()
    target = check_target(path, ENDINGS, overwrite=overwrite)
    ending = target.suffix.lower()
    encoder = _find_encoder() if ending == ".mp4" else ""
    about = f"warpspace {__version__}; scene={scene.name}; motion={settings.motion}"
    pictures = [
        Image.open(io.BytesIO(data)).convert("RGB") for data in _pictures(scene, settings, progress)
    ]
    with write_atomically(target, overwrite=overwrite) as temporary:
        if ending == ".mp4":
            _write_video(pictures, temporary, encoder, settings, about)
        else:
            temporary.write_bytes(_image_bytes(pictures, ending, settings, about))


def _pictures(
    scene: Scene, settings: AnimationSettings, progress: Progress | None
) -> Iterator[bytes]:
    """Draw all pictures, in order; a crash of a renderer becomes a message."""
    workers = max(1, min(os.cpu_count() or 1, MAX_WORKERS, settings.frames))
    pool = ProcessPool(workers)
    try:
        tasks = [pool.submit(_draw, scene, settings, number) for number in range(settings.frames)]
        for task in tasks:
            yield task.result()
            if progress is not None:
                progress(1)
    except WorkersLostError:
        if pool.ended:
            raise RenderError("the animation was given up: its renderers were ended") from None
        problem = probe_renderer()
        raise RenderError(
            f"the animation could not be drawn: {problem or 'the renderer crashed'}"
        ) from None
    finally:
        pool.kill()


def _draw(scene: Scene, settings: AnimationSettings, number: int) -> bytes:
    """Draw one picture as PNG; runs in a process of its own."""
    import matplotlib as mpl

    from warpspace.outputs.drawing.style import SAVE_RC
    from warpspace.outputs.save import figure_bytes

    with mpl.rc_context(dict(SAVE_RC)):
        drawing = draw_frame(scene, settings, number)
    return figure_bytes(drawing, "png")


def _image_bytes(
    pictures: list[Image.Image], ending: str, settings: AnimationSettings, about: str
) -> bytes:
    """Join pictures to a GIF or WebP that runs for ever."""
    duration = round(1000.0 / settings.fps)
    buffer = io.BytesIO()
    if ending == ".gif":
        palette = shared_palette(pictures)
        frames = [
            picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
        ]
        options: dict[str, Any] = {"comment": about.encode(), "optimize": False}
    else:
        frames = pictures
        options = {"quality": 85, "method": 4}
    frames[0].save(
        buffer,
        format=ending[1:],
        save_all=True,
        append_images=frames[1:],
        duration=duration,
        loop=0,
        **options,
    )
    return buffer.getvalue()


def shared_palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """Choose the 256 colours that all pictures of a GIF are drawn with.

    Parameters
    ----------
    pictures : sequence of Image
        Of one size.

    Returns
    -------
    Image
        With the palette, made from all pictures side by side: colours do not change from one
        picture to the next.
    """
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, height * len(pictures)))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (0, number * height))
    return sheet.quantize(256, dither=Image.Dither.NONE)


def _find_encoder() -> str:
    """Find the program that writes MP4; say what to install where there is none."""
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise OutputError(
            f"MP4 needs the package imageio-ffmpeg: {VIDEO_EXTRA}; GIF and WebP need nothing more"
        ) from None


def _write_video(
    pictures: list[Image.Image], path: Path, encoder: str, settings: AnimationSettings, about: str
) -> None:
    """Join pictures to an MP4 (H.264, plays everywhere); even sides, as it wants them."""
    width, height = (side // 2 * 2 for side in pictures[0].size)
    raw = b"".join(picture.crop((0, 0, width, height)).tobytes() for picture in pictures)
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    given += ["-r", f"{settings.fps:g}", "-i", "-"]
    wanted = ["-an", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"]
    wanted += ["-movflags", "+faststart", "-metadata", f"comment={about}"]
    wanted += ["-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4"]
    done = subprocess.run(
        [encoder, "-y", "-loglevel", "error", *given, *wanted, str(path)],
        input=raw,
        capture_output=True,
        check=False,
    )
    if done.returncode != 0:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"the encoder ended with {done.returncode}"
        raise OutputError(f"the video cannot be written: {reason}")
