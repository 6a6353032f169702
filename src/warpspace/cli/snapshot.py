"""Command `snapshot`."""

import click


@click.command()
def snapshot() -> None:
    """Placeholder while the command is being written."""
