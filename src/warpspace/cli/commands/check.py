"""Command `check`: validate a scene and say what it holds."""

import click

from warpspace.cli.options import json_option, print_json, scene_argument
from warpspace.cli.tables import Column, print_table, print_text


@click.command()
@scene_argument()
@json_option
def check(scene: str, *, as_json: bool) -> None:
    """Validate SCENE and say what it holds.

    All problems of a file are reported at once, each with its key, its value and what was expected.
    """
    from warpspace.bodies.own_meshes import check_meshes
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import linearisation_error_um

    loaded = load_scene(scene)
    notes = (*loaded.notes, *check_meshes(loaded.machine))
    difference = linearisation_error_um(loaded, 5)
    non_zero = [key for key in loaded.errors if loaded.errors.amplitude(key) != 0.0]
    if as_json:
        print_json(
            {
                "scene": loaded.name,
                "title": loaded.title,
                "machine": loaded.machine.name,
                "chain": str(loaded.machine.chain),
                "parameters": len(loaded.parameter_keys),
                "non_zero": non_zero,
                "linearisation_error_um": difference,
                "notes": list(notes),
            }
        )
        return
    print_text(f"{loaded.name}: valid. {loaded.title}")
    facts = [("machine", f"{loaded.machine.title}, chain {loaded.machine.chain}")]
    for name, (low, high) in loaded.workspace.ranges.items():
        span = f"{low:g}" if low == high else f"{low:g} … {high:g}"
        facts.append((name, f"{span} {loaded.machine.axes[name].unit}"))
    count = f"{len(non_zero)} of {len(loaded.parameter_keys)} parameters not zero"
    facts.append(("errors", count + (f": {', '.join(non_zero)}" if non_zero else "")))
    facts.append(("first order", f"differs from the exact chain by at most {difference:.2g} µm"))
    facts.extend(("note", note) for note in notes)
    print_table((Column(leads=True), Column(wraps=True)), facts)
