"""Tables written row by row, in a stream: Parquet or CSV, by the ending of the file."""

import csv
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from warpspace import __version__
from warpspace.outputs.files import write_atomically

ROW_ENDINGS = (".parquet", ".csv")
Kind: TypeAlias = str
"""What a column holds: "text", "integer" or "number"."""
Columns: TypeAlias = Mapping[str, Sequence[Any] | Any]
"""Values by column, all of one length; arrays are taken as they are."""
Append: TypeAlias = Callable[[Columns], None]

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


@contextmanager
def write_rows(
    path: str | Path,
    kinds: Mapping[str, Kind],
    *,
    remarks: Mapping[str, str] | None = None,
    overwrite: bool = True,
) -> Generator[Append]:
    """Open a table; the file is there once the block has ended well.

    Parameters
    ----------
    path : str or Path
        Ends in .parquet or .csv.
    kinds : mapping of str to str
        Columns in order, and what they hold.
    remarks : mapping of str to str, optional
        What the table belongs to; kept as the metadata of a Parquet file.
    overwrite : bool, optional
        Whether an existing file may be replaced.

    Yields
    ------
    callable
        Takes the values of some more rows, by column. They are written at once: no more than one
        call's rows are held.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    write = _parquet if Path(path).suffix.lower() == ".parquet" else _csv
    with (
        write_atomically(path, overwrite=overwrite) as temporary,
        write(temporary, kinds, remarks or {}) as append,
    ):
        yield append


@contextmanager
def _parquet(
    path: Path, kinds: Mapping[str, Kind], remarks: Mapping[str, str]
) -> Generator[Append]:
    """Write a Parquet file, a row group for each call."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {
        "text": pa.dictionary(pa.int32(), pa.string()),
        "integer": pa.int64(),
        "number": pa.float64(),
    }
    schema = pa.schema(
        [(name, types[kind]) for name, kind in kinds.items()],
        metadata={"warpspace": __version__, **remarks},
    )
    with pq.ParquetWriter(path, schema, compression="zstd") as writer:

        def append(columns: Columns) -> None:
            arrays = [pa.array(columns[name], field.type) for name, field in _fields(schema)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))

        yield append


def _fields(schema: Any) -> list[tuple[str, Any]]:
    """List the fields of a schema by name."""
    return [(field.name, field) for field in schema]


@contextmanager
def _csv(path: Path, kinds: Mapping[str, Kind], remarks: Mapping[str, str]) -> Generator[Append]:
    """Write a CSV file."""
    del remarks
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kinds)

        def append(columns: Columns) -> None:
            spelt = [
                [_spell(value, kind) for value in columns[name]] for name, kind in kinds.items()
            ]
            writer.writerows(zip(*spelt, strict=True))

        yield append


def _spell(value: object, kind: Kind) -> object:
    """Spell a value; numbers in full, so that they can be read back to the last bit."""
    if value is None:
        return ""
    if kind == "number":
        return repr(float(value))  # pyright: ignore[reportArgumentType]
    if kind == "text":
        text = str(value)
        # a spreadsheet would read it as a formula
        return f"'{text}" if text.startswith(_FORMULA) else text
    return value
