"""What `montecarlo` and `sweep` say of sampled machines: in words, as JSON, as a histogram."""

import math
from typing import TYPE_CHECKING

from warpspace.cli.tables import print_text

if TYPE_CHECKING:
    from warpspace.analysis.montecarlo import MonteCarlo
    from warpspace.scene.model import Scene


def result_json(result: "MonteCarlo") -> dict[str, object]:
    """Spell a result as the JSON output has it."""
    found: dict[str, object] = {
        "samples": result.plan.samples,
        "seed": result.plan.seed,
        "distribution": str(result.draws.distribution),
        "loop": str(result.view.loop),
        "over": str(result.plan.over),
        "mean_um": result.mean_um,
        "mode_um": result.mode_um,
        "median_um": result.median_um,
        "p95_um": result.p95_um,
        "p99_um": result.p99_um,
        "max_um": result.max_um,
        "histogram": {
            "edges_um": result.histogram.edges_um.tolist(),
            "counts": result.histogram.counts.tolist(),
        },
    }
    if result.probability is not None:
        found["specification"] = {
            "spec_um": result.probability.spec_um,
            "probability": result.probability.probability,
            "low": result.probability.low,
            "high": result.probability.high,
        }
    return found


def describe(result: "MonteCarlo", source: str = "tolerances") -> str:
    """Say in one line what was sampled."""
    what = {
        "sampled": "|E| at one random point each",
        "max": "largest |E| of each",
        "mean": "mean |E| of each",
    }[str(result.plan.over)]
    drawn = str(result.draws.distribution)
    if drawn == "normal":
        drawn = "normal, 3σ = half width" + (", clipped" if result.draws.clip else "")
    if source == "uncertainty":
        drawn = f"standard uncertainties, {result.draws.distribution}"
    return (
        f"{result.view.loop} loop · {result.plan.samples:,} machines, {what} · {drawn} ·"
        f" seed {result.plan.seed}"
    )


def printed_value(scene: "Scene", result: "MonteCarlo") -> float | None:
    """Give the value that the thesis prints for this distribution; None where it has none."""
    from warpspace.analysis.thesis.rows import printed_tables

    name = f"{result.view.loop}_{scene.name.removeprefix('dvf5000_')}"
    found = printed_tables()["table_4_8"]["predicted"].get(name)
    here = scene.machine.name == "dvf5000" and scene.name.startswith("dvf5000_")
    return float(found) if found and here and str(result.plan.over) == "sampled" else None


def plot_samples(
    path: str, scene: "Scene", result: "MonteCarlo", source: str, *, force: bool
) -> None:
    """Draw the histogram."""
    from warpspace.outputs.charts import montecarlo_chart, write_chart

    printed = printed_value(scene, result) if source == "tolerances" else None
    chart = montecarlo_chart(result, scene.title, describe(result, source), printed)
    write_chart(chart, path, overwrite=force)


def print_samples(scene: "Scene", result: "MonteCarlo", source: str) -> None:
    """Print the numbers."""
    from warpspace.analysis.contributions import expected_square

    print_text(f"{scene.title} · {describe(result, source)}")
    print_text(
        f"  mean {result.mean_um:.2f}, mode {result.mode_um:.1f}, median {result.median_um:.2f},"
        f" P95 {result.p95_um:.2f}, P99 {result.p99_um:.2f}, max {result.max_um:.2f} µm"
    )
    if source == "tolerances" and str(result.plan.over) == "sampled":
        variance, offset = expected_square(
            scene.model, result.draws, scene.workspace, result.view, result.plan
        )
        print_text(
            f"  RMS  {result.rms_um:.2f} µm sampled, {math.sqrt(variance.sum() + offset):.2f} µm"
            " from trace(J Σ Jᵀ) without sampling"
        )
    if source == "tolerances" and (value := printed_value(scene, result)) is not None:
        print_text(f"  the thesis prints {value:g} µm (table 4-8; see `warpspace thesis`)")
    if (kept := result.probability) is not None:
        print_text(
            f"  |E| ≤ {kept.spec_um:g} µm: {100.0 * kept.probability:.2f} % of the machines,"
            f" 95 % interval {100.0 * kept.low:.2f} … {100.0 * kept.high:.2f} %"
        )
    held = [
        key
        for key, width in zip(result.draws.keys, result.draws.half_width, strict=True)
        if width == 0.0
    ]
    if source == "uncertainty":
        print_text(f"  {len(result.draws.keys) - len(held)} errors with an uncertainty")
        return
    note = f"; held at their centre: {', '.join(held)}" if held else ""
    print_text(f"  {len(result.draws.keys) - len(held)} parameters drawn{note}")
    if not result.exact_quantiles:
        print_text("  quantiles to 0.002 % of their value")
