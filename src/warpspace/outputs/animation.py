"""Animations: pictures with one camera and one scale, joined to a GIF, WebP or MP4."""

import io
import os
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from PIL import Image

from warpspace.bodies.placed import PlacedBody, place_bodies, turning_frames
from warpspace.exceptions import OptionError, OutputError, RenderError, WorkersLostError
from warpspace.geometry.colour import component_values
from warpspace.geometry.surfaces import box_edges, deform
from warpspace.kinematics import transforms
from warpspace.kinematics.chain import branch_pose
from warpspace.kinematics.model import Loop, complete_coordinates
from warpspace.machine.axes import is_linear
from warpspace.machine.limits import ANIMATION_FRAMES
from warpspace.outputs.drawing.map3d import GHOST_DASHES, draw_map, draw_split, fit_map
from warpspace.outputs.drawing.off_screen import fit_projection
from warpspace.outputs.drawing.settings import SAVE_RC, SIZES, FigureSettings, Step, evaluate_for
from warpspace.outputs.drawing.sheet import (
    Drawing,
    line_entry,
    map_legend,
    scene_facts,
    start_sheet,
)
from warpspace.outputs.figure_files import figure_bytes
from warpspace.outputs.figures.machine_figures import draw_bodies, trace_entry
from warpspace.outputs.figures.maps import draw_statistics, isoline_words
from warpspace.outputs.figures.registry import draw_figure
from warpspace.outputs.file_output import check_target, write_atomically
from warpspace.outputs.processes import ProcessPool
from warpspace.parts.program import Program, ToolPath, explain_sample, trace_program
from warpspace.picture.formatting import quantity_words, spell_cause
from warpspace.picture.model import (
    ScenePicture,
    choose_exaggeration,
    choose_scale,
    evaluate_picture,
)
from warpspace.picture.traces import TraceLine, evaluate_traces
from warpspace.resources import __version__
from warpspace.scene.model import Scene
from warpspace.units import MICROMETRE, Array, spell, spell_fixed, spell_short

MOTIONS = ("exaggeration", "rotation", "program", "story")
MIN_FRAMES, MAX_FRAMES = ANIMATION_FRAMES
MAX_PIXELS = 1_500_000_000  # of all pictures together
_TRACE_SAMPLES = 241
STEP_S = 6  # of a story
MOST_LETTERS = 60  # of a line of the program
Frame = Callable[[], Drawing]


@dataclass(frozen=True, slots=True)
class AnimationSettings:
    """Options of an animation."""

    # "exaggeration" (from true scale to the display factor and back), "rotation" (one turn of the
    # rotary axis next to the workpiece), "program" (along its path) or "story" (step by step)
    motion: str = "exaggeration"
    frames: int = 48  # pictures of one round; the last leads back to the first
    fps: float = 15.0  # pictures a second
    # component, display factor, view, size, loop, grid and theme
    figure: FigureSettings = field(default_factory=lambda: FigureSettings(size=(960, 720)))
    program: Program = field(default_factory=Program)  # by default that of the scene
    steps: Sequence[Step] = ()  # of the story

    def __post_init__(self) -> None:
        if self.motion not in MOTIONS:
            raise OptionError(f"motion {self.motion!r}; expected one of {', '.join(MOTIONS)}")
        if not MIN_FRAMES <= self.frames <= MAX_FRAMES:
            raise OptionError(f"frames: {self.frames}; expected {MIN_FRAMES} to {MAX_FRAMES}")
        if not 1.0 <= self.fps <= 60.0:
            raise OptionError(f"fps: {self.fps:g}; expected 1 to 60 pictures a second")
        width, height = self.figure.size
        if self.frames * width * height > MAX_PIXELS:
            raise OptionError(
                f"{self.frames} pictures of {width}x{height} are too many; expected at most"
                f" {MAX_PIXELS // (width * height)} of that size"
            )


def default_frames(motion: str, n_steps: int = 0) -> tuple[int, float]:
    """Return the number of pictures, and of pictures a second; each step of a story stays."""
    return {"program": (160, 8.0), "story": (min(STEP_S * max(n_steps, 1), MAX_FRAMES), 1.0)}.get(
        motion, (48, 15.0)
    )


def build_frames(scene: Scene, settings: AnimationSettings) -> list[Frame]:
    """Build the functions that draw the pictures; the same one where a picture stays."""
    figure, shares = settings.figure, np.arange(settings.frames) / settings.frames
    if settings.motion == "program":
        return _program_frames(scene, settings)
    if settings.motion == "story":
        if not settings.steps:
            raise OptionError(
                f"{scene.name}: no story to animate; expected notes with a place in it"
            )
        drawn = [
            partial(
                draw_figure,
                name,
                scenes,
                replace(step, size=figure.size, caption=text.partition("\n")[0]),
            )
            for text, name, scenes, step in settings.steps
        ]
        return [drawn[int(share * len(drawn))] for share in shares]
    draw = _rotation_frame if settings.motion == "rotation" else _exaggeration_frame
    return [partial(draw, scene, figure, float(share)) for share in shares]


def sweep_factor(top: float, phase: float) -> float:
    """Compute the display factor at a phase of the sweep: 1 at its ends, the top in its middle."""
    share = (1.0 - np.cos(2.0 * np.pi * phase)) / 2.0
    return float(f"{1.0 + (top - 1.0) * share:.3g}")


def _exaggeration_frame(scene: Scene, figure: FigureSettings, phase: float) -> Drawing:
    largest = evaluate_for(figure, scene)
    factor = sweep_factor(largest.exaggeration, phase)
    picture = replace(largest, exaggeration=factor)
    scale = picture.scale
    title = f"Volumetric error: {scene.title}"
    facts = scene_facts(picture, factor)
    legend = map_legend(isoline_words(scale), picture.exceeded_um)
    sheet = start_sheet("exaggeration", figure, title, facts, [scene], legend, exact=True)
    camera = fit_map(sheet.canvas, [picture, largest], sheet.content, figure.view)
    drawn = draw_map(sheet.canvas, picture, sheet.content, figure.view, projection=camera)
    draw_statistics(sheet, picture, camera.px_per_mm)
    return sheet.finish(factor, [drawn])


def one_round(scene: Scene) -> tuple[str, Array, list[TraceLine]]:
    groups = evaluate_traces(scene, 1.0, _TRACE_SAMPLES)
    if not groups:
        raise OptionError(
            f"{scene.name}: no trace to animate; expected a rotary axis, and points in [points_mm]"
            " traces"
        )
    positions, group = scene.workspace.positions, groups[0].group
    side = "workpiece" if group.loop is Loop.WORKPIECE else "tool"
    axis = [axis.name for axis in scene.machine.branch(side) if not axis.is_linear][-1]
    lines = {
        number: line
        for number, line in enumerate(groups[0].each())
        if line.trace.axis == axis
        and all(positions.get(name, 0.0) == at for name, at in line.trace.at.items())
    }
    return axis, group.coordinates[axis][next(iter(lines))], list(lines.values())


def _rotation_frame(scene: Scene, figure: FigureSettings, phase: float) -> Drawing:
    axis, turn_deg, lines = one_round(scene)
    at = round(phase * (len(turn_deg) - 1))
    angle = float(turn_deg[at])
    turned = replace(scene, workspace=scene.workspace.moved({axis: angle}))
    nominal = np.stack([line.nominal_mm for line in lines])
    error = np.stack([line.error_um for line in lines])
    size = np.linalg.norm(error, axis=-1)
    edge = float(np.ptp(nominal.reshape(-1, 3), axis=0).max())
    factor = choose_exaggeration(figure.exaggeration, scene.exaggeration, float(size.max()), edge)
    actual = deform(nominal, error, factor)
    scale = choose_scale([size], "norm")
    picture = evaluate_picture(turned, grid=3, loop="workpiece", exaggeration=factor)
    title = f"Rotary traces: {scene.title}"
    facts = scene_facts(picture, factor)
    sheet = start_sheet("rotation", figure, title, facts, [scene], [], exact=True)
    canvas = sheet.canvas
    carried = [axis.name for axis in scene.machine.branch("workpiece")]
    placed = place_bodies(turned, picture.view, factor, [*carried, "w"])
    x_left, bottom, right, top = sheet.content
    side = 0.03 * (right - x_left)
    reach = [nominal.reshape(-1, 3), actual.reshape(-1, 3), *map(_swept, placed)]
    camera = fit_projection(
        figure.view, np.concatenate(reach), (x_left + side, bottom + side, right - side, top - side)
    )
    draw_bodies(canvas, placed, camera)
    for nominal_mm, actual_mm, length in zip(nominal, actual, size, strict=True):
        ghost, spots = camera.project(nominal_mm), camera.project(actual_mm)
        canvas.lines([ghost], width=SIZES.line, colour=canvas.theme.ghost, dashes=(8.0, 5.0))
        canvas.lines([spots], width=SIZES.hair, colour=canvas.theme.muted, alpha=0.6)
        swept = [spots[step : step + 2] for step in range(at)]
        colours = scale.colours(length[:at]) / 255.0
        canvas.lines(swept, width=3.4, colour=colours, zorder=3.0)
        canvas.disc(ghost[at], 4.0, canvas.theme.ghost)
        canvas.disc(spots[at], 5.0, canvas.theme.accent)
    rows = [(axis, f"{spell_short(round(angle, 1))}°")]
    for point, length in zip(scene.trace_points_mm, size, strict=False):
        coordinates = ", ".join(map(spell_short, point))
        rows.append((f"|E| of ({coordinates})", f"{spell(float(length[at]))} µm"))
    marks = [("max", float(size.max())), ("mean", float(size.mean()))]
    sheet.draw_panel(scale, "|E|  [µm]", marks, rows, (camera.px_per_mm, factor))
    return sheet.finish(factor)


def _program_frames(scene: Scene, settings: AnimationSettings) -> list[Frame]:
    """Build the pictures along a program, with the same number of samples between them."""
    analysis = settings.program.of_scene(scene)
    program, lines = analysis.read(scene), [*analysis.lines()]
    path = trace_program(program)
    samples = np.linspace(0, len(path.line) - 1, settings.frames).astype(int).tolist()
    picture = evaluate_for(settings.figure, scene)
    corners = [
        _box_corners(part.vertices_mm)
        for sample in samples
        for part in _turning_bodies(picture, path, sample)
    ]
    reach = np.concatenate([np.zeros((0, 3)), *corners])
    stand = complete_coordinates(scene.machine, {}, scene.workspace.positions)
    pose = np.asarray(branch_pose(scene.model, "workpiece", stand))
    tip, error_um = transforms.apply(pose, path.tip_mm), path.error_um @ pose[:3, :3].T
    in_r = replace(path, tip_mm=tip, error_um=error_um, uncertainty=None)
    frames: list[Frame] = []
    for sample in samples:
        point = explain_sample(program, path, sample)
        code = lines[point.line - 1].strip()[:MOST_LETTERS] if point.line <= len(lines) else ""
        causes = [spell_cause(key, um / point.um) for key, um in point.budget.items() if point.um]
        error = ", ".join([f"|E| {spell_fixed(point.um)} {MICROMETRE}", *causes[:1]])
        figure = replace(settings.figure, caption=f"line {point.line}: {code}\n{error}")
        frames.append(partial(_program_frame, scene, figure, in_r, sample, reach))
    return frames


def _turning_bodies(picture: ScenePicture, path: ToolPath, sample: int) -> tuple[PlacedBody, ...]:
    """Place the rotary axes at a sample; the path is drawn where the linear axes stand."""
    scene = picture.scene
    positions = {name: at for name, at in path.axes_at(sample).items() if not is_linear(name)}
    turning = turning_frames(scene.machine)
    return place_bodies(scene, picture.view, picture.exaggeration, turning, positions=positions)


def _program_frame(
    scene: Scene, figure: FigureSettings, path: ToolPath, sample: int, reach_mm: Array
) -> Drawing:
    picture = evaluate_for(figure, scene)
    factor, values = picture.exaggeration, component_values(path.error_um, figure.component)
    legend = [
        line_entry("nominal volume", lambda theme: theme.ghost, dashes=GHOST_DASHES),
        line_entry("nominal path", lambda theme: theme.muted, SIZES.thin),
        trace_entry("actual path, exaggerated, coloured by its error"),
    ]
    title, facts = f"Path of the program: {scene.title}", scene_facts(picture, factor)
    sheet = start_sheet("program", figure, title, facts, [scene], legend, exact=True)
    canvas, nodes = sheet.canvas, picture.grid.nominal_mm.reshape(-1, 3)
    actual_mm = deform(path.tip_mm, path.error_um, factor)
    side, (x_left, bottom, right, top) = canvas.px(20.0), sheet.content
    inner = (x_left + side, bottom + side, right - side, top - side)
    reach = np.concatenate([nodes, path.tip_mm, actual_mm, reach_mm])
    camera = fit_projection(figure.view, reach, inner)
    bodies = _turning_bodies(picture, path, sample)
    machine = draw_bodies(canvas, bodies, camera, nominal=False)
    edges = (nodes[edge] for edge in box_edges(picture.shape))
    style = {"colour": canvas.theme.ghost, "dashes": GHOST_DASHES, "zorder": 2.2}
    draw_split(canvas, edges, camera, machine, alpha=(1.0, 0.5), **style)
    ends = np.flatnonzero(path.step_mm.any(axis=1))
    segments = np.stack([ends - 1, ends], axis=1)
    nominal, actual = camera.project(path.tip_mm)[segments], camera.project(actual_mm)
    canvas.lines([*nominal], width=SIZES.thin, colour=canvas.theme.muted, zorder=3.0)
    colours = picture.scale.colours(values[segments].mean(axis=1)) / 255.0
    canvas.lines([*actual[segments]], width=3.4, colour=colours, zorder=3.5)
    canvas.disc(actual[sample], 6.0, canvas.theme.accent)
    marks = [("max", float(values.max())), ("mean", float(values.mean()))]
    rows = [(name, f"{spell_fixed(um)} {MICROMETRE}") for name, um in marks]
    heading, bars = quantity_words(figure.component), (camera.px_per_mm, factor)
    sheet.draw_panel(picture.scale, heading, marks, rows, bars)
    return sheet.finish(factor)


def _box_corners(points_mm: Array) -> Array:
    return _corners(points_mm.min(axis=0), points_mm.max(axis=0))


def _swept(part: PlacedBody) -> Array:
    points = part.nominal_mm
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2.0
    reach = float(np.linalg.norm((points - middle)[:, :2], axis=1).max())
    low[:2], high[:2] = middle[:2] - reach, middle[:2] + reach
    return _corners(low, high)


def _corners(low: Array, high: Array) -> Array:
    return np.stack(np.meshgrid(*np.stack([low, high], -1)), -1).reshape(-1, 3)


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
    settings = settings or AnimationSettings()
    target = check_target(path, ENDINGS, overwrite=overwrite)
    ending = target.suffix.lower()
    encoder = _find_encoder() if ending == ".mp4" else ""
    about = f"warpspace {__version__}; scene={scene.name}; motion={settings.motion}"
    frames = build_frames(scene, settings)
    pictures = [Image.open(io.BytesIO(data)).convert("RGB") for data in _pictures(frames, progress)]
    with write_atomically(target, overwrite=overwrite) as temporary:
        if ending == ".mp4":
            _write_video(pictures, temporary, encoder, settings, about)
        else:
            _write_images(pictures, temporary, ending, settings, about)


def _pictures(frames: Sequence[Frame], progress: Progress | None) -> Iterator[bytes]:
    different = dict.fromkeys(frames)
    pool = ProcessPool(max(1, min(os.cpu_count() or 1, MAX_WORKERS, len(different))))
    try:
        tasks = {frame: pool.submit(_draw, frame) for frame in different}
        for frame in frames:
            yield tasks[frame].result()
            if progress is not None:
                progress(1)
    except WorkersLostError:
        if pool.ended:
            raise RenderError("the animation was stopped: its renderers were ended") from None
        raise RenderError("the animation could not be drawn: the renderer crashed") from None
    finally:
        pool.kill()


def _draw(frame: Frame) -> bytes:
    with mpl.rc_context(SAVE_RC):
        drawing = frame()
    return figure_bytes(drawing, "png")


def _write_images(
    pictures: list[Image.Image], path: Path, ending: str, settings: AnimationSettings, about: str
) -> None:
    duration = round(1000.0 / settings.fps)
    if ending == ".gif":
        palette = shared_palette(pictures)
        frames = [
            picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
        ]
        options: dict[str, Any] = {"comment": about.encode(), "optimize": False}
    else:
        frames = pictures
        options = {"quality": 85, "method": 4}
    options |= {"save_all": True, "append_images": frames[1:], "duration": duration, "loop": 0}
    frames[0].save(path, format=ending[1:], **options)


def shared_palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """Choose the 256 colours that all pictures of a GIF are drawn with."""
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, height * len(pictures)))
    for number, picture in enumerate(pictures):
        sheet.paste(picture, (0, number * height))
    return sheet.quantize(256, dither=Image.Dither.NONE)


def _find_encoder() -> str:
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise OutputError(
            f"MP4 needs the package imageio-ffmpeg: {VIDEO_EXTRA}; GIF and WebP need no package"
        ) from None


def _write_video(
    pictures: list[Image.Image], path: Path, encoder: str, settings: AnimationSettings, about: str
) -> None:
    width, height = (side // 2 * 2 for side in pictures[0].size)
    raw = b"".join(picture.crop((0, 0, width, height)).tobytes() for picture in pictures)
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    source += ["-r", f"{settings.fps:g}", "-i", "-"]
    encoding = ["-an", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"]
    encoding += ["-movflags", "+faststart", "-metadata", f"comment={about}"]
    encoding += ["-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4"]
    command = [encoder, "-y", "-loglevel", "error", *source, *encoding, str(path)]
    process = subprocess.run(command, input=raw, capture_output=True, check=False)
    if process.returncode != 0:
        lines = process.stderr.decode(errors="replace").strip().splitlines()
        reason = lines[-1] if lines else f"the encoder ended with {process.returncode}"
        raise OutputError(f"the video cannot be written: {reason}")
