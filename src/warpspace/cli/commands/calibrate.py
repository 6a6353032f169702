"""Command `calibrate`: the errors of a machine out of measured data."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.file_options import (
    check_output,
    check_targets,
    csv_option,
    force_option,
    output_option,
    plot_option,
)
from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.results.calibration import (
    calibration_json,
    print_apart,
    print_calibration,
    write_residuals,
)
from warpspace.cli.terminal import echo
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from pathlib import Path

    from warpspace.calibration.next_best import Step
    from warpspace.calibration.results import Calibration

ENDINGS = (".toml",)


@click.command()
@scene_argument()
@click.option(
    "--data",
    required=True,
    multiple=True,
    metavar="FILE",
    help="CSV file of readings, or the name of a bundled one such as tcp_on.csv. Repeatable.",
)
@click.option(
    "--kind",
    "kinds",
    multiple=True,
    metavar="KIND",
    help="points, sphere, sphere-tcp, lengths, or a test with its options such as"
    " circular:plane=XZ:radius=150 (`warpspace test --list`; its test sphere is r-test here)."
    " Once for all files, or once for each, --data before --predict."
    "  [told by the columns of each file]",
)
@click.option(
    "--fit",
    multiple=True,
    metavar="KEYS|auto",
    help="Parameters to find, with commas between; KEY:ramp and KEY:constant choose the curve of a"
    " component error.  [auto: those that the readings can show]",
)
@click.option(
    "--predict",
    multiple=True,
    metavar="FILE",
    help="Readings that are not fitted but predicted. Repeatable.",
)
@click.option("--robust", is_flag=True, help="Let readings far off count less.")
@click.option("--priors", is_flag=True, help="Count the tolerances of SCENE as knowledge.")
@click.option(
    "--next",
    "next_count",
    type=int,
    metavar="N",
    help="Name the N measurements that would lower the uncertainty of the map most.",
)
@output_option("Write SCENE with the errors found: .toml.", required=False)
@plot_option("residuals before and after, and the errors found")
@csv_option
@force_option
@json_option
def calibrate(
    scene: str,
    data: tuple[str, ...],
    kinds: tuple[str, ...],
    fit: tuple[str, ...],
    predict: tuple[str, ...],
    next_count: int | None,
    output: str | None,
    plot: str | None,
    csv_path: str | None,
    *,
    robust: bool,
    priors: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Find the errors of the machine of SCENE in measured data.

    Least squares with the exact model; it says which parameters the readings determine, which they
    cannot tell apart, standard uncertainties and 95 % intervals, and what is left. Readings with a
    column u_um (standard uncertainty) are weighted by it. A column session, or run, tells set-ups
    apart: each has its own place of the sphere or the station, or its own shift.
    """
    from warpspace.calibration.calibrate import calibrate as find
    from warpspace.calibration.next_best import next_best, separating
    from warpspace.calibration.readings import find_data, read_readings
    from warpspace.calibration.results import Request
    from warpspace.calibration.terms import read_keys
    from warpspace.scene.library import load_scene

    files = [find_data(name) for name in (*data, *predict)]
    target = _target(output, ENDINGS, scene, files, force=force)
    check_targets(scene, force=force, plot=plot, csv_path=csv_path)
    loaded = load_scene(scene)
    request = Request(read_keys(fit), robust=robust, priors=priors)
    each = _each(kinds, len(files))
    read = [
        read_readings(name, loaded, kind)
        for name, kind in zip((*data, *predict), each, strict=True)
    ]
    sets, held = read[: len(data)], read[len(data) :]
    with progress("fitting", silent=as_json):
        found = find(loaded, sets, request, held)
    circles = [circle for one in sets for circle in one.circles]
    apart: dict[tuple[str, ...], str] = {}
    steps: Sequence[Step] = ()
    if next_count is not None or found.rank.confounded:
        with progress("looking for further measurements", silent=as_json):
            apart = separating(loaded, sets, found)
            steps = next_best(loaded, sets, found, next_count) if next_count is not None else ()
    if target is not None:
        _write_scene(target, found, force=force)
    if csv_path is not None:
        write_residuals(csv_path, found, force=force)
    if plot is not None:
        from warpspace.outputs.charts import calibration_chart, write_chart

        write_chart(
            calibration_chart(found, f"Calibration · {loaded.title}"), plot, overwrite=force
        )
    if as_json:
        print_json(calibration_json(found, circles, apart, steps))
        return
    print_calibration(loaded, found, sets, circles)
    print_apart(found, apart, steps)
    for path in filter(None, (output, csv_path, plot)):
        echo(f"wrote {path}")


def _each(kinds: Sequence[str], files: int) -> Sequence[str | None]:
    """Give each file its kind.

    Raises
    ------
    OptionError
        If there are neither one nor as many kinds as files.
    """
    if len(kinds) <= 1:
        return [kinds[0] if kinds else None] * files
    if len(kinds) != files:
        raise OptionError(
            f"--kind is given {len(kinds)} times for {files} files; expected 1 or {files}"
        )
    return kinds


def _target(
    output: str | None, endings: Sequence[str], scene: str, files: "Sequence[Path]", *, force: bool
) -> "Path | None":
    """Check where the scene is to be written; neither the scene nor the data are replaced."""
    if output is None:
        return None
    from warpspace.outputs.files import check_target

    target = check_output(output, endings, force=force, scenes=[scene])
    return check_target(target, endings, overwrite=force, inputs=files)


def _write_scene(target: "Path", found: "Calibration", *, force: bool) -> None:
    """Write the calibrated scene."""
    from warpspace.outputs.files import write_atomically
    from warpspace.scene.save import scene_to_toml

    with write_atomically(target, overwrite=force) as temporary:
        temporary.write_text(scene_to_toml(found.scene), encoding="utf-8")
