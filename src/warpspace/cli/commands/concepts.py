"""Command `concepts`: machines side by side within the same tolerances."""

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from warpspace.cli.figure_options import draw_figure_file, parse_size
from warpspace.cli.file_options import (
    check_output,
    check_targets,
    csv_option,
    force_option,
    plot_option,
)
from warpspace.cli.options import LOOPS, json_option, print_json, scene_argument
from warpspace.cli.progress import progress
from warpspace.cli.sampling_options import (
    clip_option,
    distribution_option,
    samples_option,
    seed_option,
)
from warpspace.cli.tables import Column, number_columns, print_table, print_text
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.scene.concepts import Concept, ConceptPlan


@click.command()
@scene_argument("scenes", metavar="SCENE…", nargs=-1, required=True)
@click.option("--limit-um", type=float, help="Of |E| in µm, to say how likely it is kept.")
@click.option(
    "--own-tolerances",
    is_flag=True,
    help="Each scene with its own tolerances instead of those of the first one by class.",
)
@click.option(
    "--over",
    type=click.Choice(("sampled", "max")),
    default="sampled",
    show_default=True,
    help="|E| at a random point of each sampled machine, or its largest over the working volume.",
)
@click.option(
    "--loop",
    type=click.Choice(LOOPS),
    default="relative",
    show_default=True,
    help="Tool relative to workpiece, so that axes count on either side; or one of both alone.",
)
@samples_option
@seed_option
@distribution_option
@clip_option
@csv_option
@plot_option("machines side by side")
@click.option(
    "--size", default="1600x1200", show_default=True, metavar="WxH", help="Of the picture, in px."
)
@force_option
@json_option
def concepts(
    scenes: Sequence[str],
    limit_um: float | None,
    over: str,
    loop: str,
    samples: int,
    seed: int,
    distribution: str,
    csv_path: str | None,
    plot: str | None,
    size: str,
    *,
    own_tolerances: bool,
    clip: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Compare machines before one of them is built.

    Machines of each SCENE are drawn from the same tolerances: those of the first one for
    translations, rotations and squarenesses. Printed are mean, 95 % and largest |E|, how many
    machines keep the limit, and the three errors that add most to the variance of E. Errors are
    absolute: no point is held still, whatever a scene says. `warpspace montecarlo` and
    `warpspace contributions` give more of each machine.
    """
    from warpspace.machine.limits import MOST_CONCEPTS
    from warpspace.outputs.drawing.settings import FigureSettings
    from warpspace.outputs.files import write_atomically
    from warpspace.scene.concepts import ConceptPlan, compare_concepts
    from warpspace.scene.library import load_scene

    if len(scenes) > MOST_CONCEPTS:
        raise OptionError(f"{len(scenes)} scenes; expected at most {MOST_CONCEPTS}")
    check_targets(*scenes, force=force, plot=plot, csv_path=csv_path)
    plan = ConceptPlan(limit_um, own_tolerances, samples, seed, distribution, clip, over)
    settings = FigureSettings(size=parse_size(size), loop=loop, concepts=plan)
    if plot is not None and len(scenes) < 2:
        raise OptionError("--plot sets machines side by side; expected two scenes or more")
    loaded = [load_scene(name) for name in scenes]
    total = max(samples, 0) * len(loaded)
    with progress("sampling", total, "machines", silent=as_json) as bar:
        found = compare_concepts(loaded, plan, loop=loop, progress=bar.advance)
    if plot is not None:
        target = check_output(plot, (".png", ".svg", ".pdf"), force=force, scenes=scenes)
        draw_figure_file("concepts", loaded, settings, target, force=force, silent=as_json)
    if csv_path is not None:
        with write_atomically(csv_path, overwrite=force) as temporary:
            temporary.write_text(result_csv(found), encoding="utf-8", newline="")
    if as_json:
        print_json(result_json(found, plan, loop))
        return
    _print(found, plan, loop)
    for path in (csv_path, plot):
        if path is not None:
            print_text(f"wrote {path}")


def result_json(found: "Sequence[Concept]", plan: "ConceptPlan", loop: str) -> dict[str, object]:
    """Spell the comparison as the JSON output has it."""
    return {
        "loop": loop,
        "over": str(plan.over),
        "distribution": str(plan.distribution),
        "samples": plan.samples,
        "seed": plan.seed,
        "limit_um": plan.limit_um,
        "own_tolerances": plan.own_tolerances,
        "tolerances": None if plan.own_tolerances else dict(found[0].scene.tolerances.default),
        "concepts": [_concept_json(concept) for concept in found],
    }


def _concept_json(concept: "Concept") -> dict[str, object]:
    """Spell one machine."""
    from warpspace.machine.parameters import parameter

    sampled, kept = concept.sampled, concept.sampled.probability
    return {
        "scene": concept.scene.name,
        "title": concept.scene.title,
        "chain": str(concept.scene.machine.chain),
        "mean_um": sampled.mean_um,
        "p95_um": sampled.p95_um,
        "max_um": sampled.max_um,
        "probability": None if kept is None else kept.probability,
        "low": None if kept is None else kept.low,
        "high": None if kept is None else kept.high,
        "rms_um": concept.shares.rms_um,
        "errors": [
            {
                "key": row.key,
                "name": parameter(row.key).name,
                "half_width": row.half_width,
                "unit": row.unit,
                "share": row.share,
            }
            for row in concept.leading
        ],
    }


def result_csv(found: "Sequence[Concept]") -> str:
    """Spell the comparison as CSV: a row for each machine, units in the names of columns."""
    from warpspace.scene.concepts import NAMED

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    errors = [
        name for rank in range(1, NAMED + 1) for name in (f"error_{rank}", f"error_{rank}_share")
    ]
    numbers = ["mean_um", "p95_um", "max_um", "limit_um", "probability"]
    writer.writerow(["scene", "title", "chain", "loop", *numbers, *errors])
    for concept in found:
        sampled, kept = concept.sampled, concept.sampled.probability
        leading = [value for row in concept.leading for value in (row.key, f"{row.share:.9g}")]
        writer.writerow(
            [
                concept.scene.name,
                _safe(concept.scene.title),
                str(concept.scene.machine.chain),
                str(sampled.view.loop),
                *(f"{value:.9g}" for value in (sampled.mean_um, sampled.p95_um, sampled.max_um)),
                "" if kept is None else f"{kept.spec_um:.9g}",
                "" if kept is None else f"{kept.probability:.9g}",
                *leading,
                *[""] * (len(errors) - len(leading)),
            ]
        )
    return text.getvalue()


def _safe(text: str) -> str:
    """Keep a spreadsheet from reading a title as a formula."""
    return f"'{text}" if text[:1] in {"=", "+", "-", "@", "\t", "\r"} else text


def _print(found: "Sequence[Concept]", plan: "ConceptPlan", loop: str) -> None:
    """Print a line for each machine, and what was compared."""
    from warpspace.scene.concepts import LETTERS

    if plan.own_tolerances:
        tolerances = "each with its own tolerances"
    else:
        default = found[0].scene.tolerances.default
        spelled = ", ".join(f"{name} ±{value:g}" for name, value in default.items())
        tolerances = f"the tolerances of {found[0].scene.name}: {spelled} (µm, µrad)"
    where = "everywhere" if plan.over == "max" else "at a random point"
    print_text(f"{loop} loop · evaluated {where} · {plan.distribution} · {tolerances}")
    with_limit = plan.limit_um is not None
    columns = (
        Column("", leads=True),
        Column("scene", leads=True),
        Column("chain"),
        *number_columns(("mean", "P95", "max"), "µm"),
        *(number_columns((f"≤ {plan.limit_um:g} µm",), "%") if with_limit else ()),
        Column("matter most", "share of the variance", wraps=True),
    )
    rows = [
        (
            letter,
            concept.scene.name,
            str(concept.scene.machine.chain),
            *(
                f"{value:.2f}"
                for value in (
                    concept.sampled.mean_um,
                    concept.sampled.p95_um,
                    concept.sampled.max_um,
                )
            ),
            *(
                [f"{100.0 * concept.sampled.probability.probability:.2f}"]
                if concept.sampled.probability is not None
                else []
            ),
            ", ".join(f"{row.key} {100.0 * row.share:.0f} %" for row in concept.leading),
        )
        for letter, concept in zip(LETTERS, found, strict=False)
    ]
    print_table(columns, rows, indent=0)
