"""|E| of every sampled machine, written as a table while the machines are sampled."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from warpspace.cli.file_options import check_output
from warpspace.exceptions import OptionError

if TYPE_CHECKING:
    from warpspace.analysis.montecarlo import Take
    from warpspace.units import Array

MOST_CSV_ROWS = 10_000_000


def check_machine_table(
    output: str | None, names: Sequence[str], samples: int, *, force: bool
) -> None:
    """Check where |E| of every machine is to be written, before any is sampled.

    Raises
    ------
    OptionError, OutputError
        If the file cannot or must not be written, or a CSV file would be too long.
    """
    from warpspace.outputs.exports.rows import ROW_ENDINGS

    if output is None:
        return
    check_output(output, ROW_ENDINGS, force=force, scenes=names)
    rows = samples * len(names)
    if output.lower().endswith(".csv") and rows > MOST_CSV_ROWS:
        raise OptionError(
            f"{output}: {rows:,} rows; expected at most {MOST_CSV_ROWS:,} in a CSV file"
            " (.parquet holds any number)"
        )


@contextmanager
def machine_table(
    output: str | None, names: Sequence[str], *, force: bool
) -> "Generator[Take | None]":
    """Give what takes |E| of the machines of a case and writes it; None where nothing is written.

    Parameters
    ----------
    output : str or None
    names : sequence of str
        Of the scenes, by the number of their case.
    force : bool
        Whether an existing file may be replaced.
    """
    import numpy as np

    from warpspace.outputs.exports.rows import write_rows

    if output is None:
        yield None
        return
    kinds = {"scene": "text", "machine": "integer", "error_um": "number"}
    at, done = 0, 0
    with write_rows(output, kinds, overwrite=force) as append:

        def take(case: int, values: "Array") -> None:
            nonlocal at, done
            if case != at:
                at, done = case, 0
            machine = np.arange(done, done + len(values))
            done += len(values)
            scene = [names[case]] * len(values)
            append({"scene": scene, "machine": machine, "error_um": values})

        yield take
