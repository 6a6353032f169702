"""Commands `check` and `scenes`: validate a scene, list the bundled ones."""

import click

from warpspace.cli.options import json_option, print_json, scene_argument


@click.command()
@scene_argument()
@json_option
def check(scene: str, *, as_json: bool) -> None:
    """Validate SCENE and say what it holds.

    All problems of a file are reported at once, each with its key, its value and what was expected.
    """
    from warpspace.scene.library import load_scene
    from warpspace.scene.pipeline import linearisation_error_um

    loaded = load_scene(scene)
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
                "notes": list(loaded.notes),
            }
        )
        return
    click.echo(f"{loaded.name}: valid. {loaded.title}")
    click.echo(f"  machine    {loaded.machine.title}, chain {loaded.machine.chain}")
    for name, (low, high) in loaded.workspace.ranges.items():
        span = f"{low:g}" if low == high else f"{low:g} … {high:g}"
        click.echo(f"  {name:<10} {span} {loaded.machine.axes[name].unit}")
    click.echo(
        f"  errors     {len(non_zero)} of {len(loaded.parameter_keys)} parameters not zero"
        + (f": {', '.join(non_zero)}" if non_zero else "")
    )
    click.echo(f"  first order differs from the exact chain by at most {difference:.2g} µm")
    for note in loaded.notes:
        click.echo(f"  note       {note}")


@click.command()
@json_option
def scenes(*, as_json: bool) -> None:
    """List the bundled scenes."""
    from warpspace.scene.library import load_scene, scene_names

    titles = {name: load_scene(name).title for name in scene_names()}
    if as_json:
        rows = [{"name": name, "title": title} for name, title in titles.items()]
        print_json({"scenes": rows})
        return
    width = max(map(len, titles))
    for name, title in titles.items():
        click.echo(f"{name:<{width}}  {title}")
