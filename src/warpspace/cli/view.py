"""Command `view`."""

import click


@click.command()
def view() -> None:
    """Placeholder while the command is being written."""
