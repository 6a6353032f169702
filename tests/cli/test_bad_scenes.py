"""Every malformed scene: exit 2, one message with file, key, value and what was expected."""

from pathlib import Path

import pytest

DVF = 'machine = "dvf5000"\n'
LATHE = '[machine]\nchain = "wCFXZt"\n'
FORMS = "expected a number or one of { ramp = }, { poly = }, { harmonics = }, { table = }"
TRIPLE = "expected [x, y, z]"

MALFORMED = {
    # names
    "unknown section": (DVF + "eror = 1", "eror: unknown key", "did you mean 'errors'?"),
    "unknown key": (DVF + "view.exageration = 1", "view.exageration: unknown key", "exaggeration"),
    "unknown parameter": (
        DVF + "[errors]\nEAXX = 1",
        "errors.EAXX: unknown error parameter",
        "EAX",
    ),
    "parameter of no axis": (DVF + "[errors]\nEAA = 1", "errors.EAA", "wCBFXYZt has no axis A"),
    "tolerance of nothing": (DVF + "[tolerances]\nEC0 = 1", "tolerances.EC0", "did you mean"),
    "unknown axis": (DVF + "workspace.Q = 0", "workspace.Q", "expected one of X, Y, Z, B, C"),
    "unknown frame": (LATHE + "offset_mm.Y = [0, 0, 0]", "machine.offset_mm.Y", "X, Z, C, S, t, w"),
    "unknown machine": ('machine = "dvf500"', 'machine = "dvf500"', "did you mean 'dvf5000'?"),
    "no machine": ('title = "x"', "machine: is missing", "[machine] table"),
    "key with control characters": (
        '"\\u001b[31m\\n" = 1\n' + DVF,
        '"\\u001b[31m\\n": unknown key',
    ),
    # types
    "text for a number": (DVF + '[errors]\nEAX = "5"', 'errors.EAX = "5"', FORMS),
    "yes for a number": (DVF + "[errors]\nEAX = true", "errors.EAX = true", FORMS),
    "date for a number": (DVF + "[errors]\nEAX = 2024-02-01", "errors.EAX = 2024-02-01", FORMS),
    "time for a table": (DVF + "view = 07:32:00", "view = 07:32:00: expected a table"),
    "text in a ramp": (DVF + '[errors]\nEAX = { ramp = "a" }', 'errors.EAX.ramp = "a": expected a'),
    "text in a poly": (DVF + '[errors]\nEAX = { poly = [1, "a"] }', 'errors.EAX.poly[1] = "a"'),
    "text in a table": (
        DVF + '[errors]\nEAX = { table = [[0, "b"]] }',
        'errors.EAX.table[0][1] = "b": expected a number',
    ),
    "number for a text": (DVF + "title = 5", "title = 5: expected a text"),
    "number for a section": (DVF + "errors = 3", "errors = 3: expected a table"),
    "number for a machine": ("machine = 5", "machine = 5: expected a machine name or a [machine]"),
    "text for a range": (DVF + 'workspace.X = "a"', "expected a number or [lower, upper]"),
    "text for a tolerance": (DVF + 'tolerances.EAX = "a"', "expected a half width or { centre"),
    "text for a factor": (DVF + 'view.exaggeration = "big"', '"auto" or a number above 0'),
    "text for a reference": (DVF + 'view.reference = "abs"', 'expected "absolute" or axis coord'),
    "number for points": (DVF + "points_mm.traces = 5", "points_mm.traces = 5: expected a list"),
    "convention of no kind": (
        DVF + 'convention.component_errors = "after"',
        'convention.component_errors = "after": expected "after_motion" or "before_motion"',
    ),
    # numbers
    "not a number": (DVF + "[errors]\nEAX = nan", "errors.EAX = nan: expected a finite number"),
    "infinite ramp": (DVF + "[errors]\nEAX = { ramp = inf }", "errors.EAX.ramp = inf", "finite"),
    "infinite point": (DVF + "points_mm.tool = [0, -inf, 0]", "points_mm.tool[1] = -inf", "finite"),
    "1e9 as an error": (DVF + "[errors]\nEAX = 1e9", "errors.EAX = 1000000000.0", "at most 100000"),
    "1e9 as a length": (DVF + "workspace.X = 1e9", "workspace.X = 1000000000.0", "at most 100000"),
    "10^400": (DVF + f"[errors]\nEAX = 1{'0' * 400}", "errors.EAX = a whole number of 1329 bits"),
    "10^5000": (DVF + f"[errors]\nEAX = 1{'0' * 5000}", "is not valid TOML", "4300 digits"),
    "16^5000": (DVF + f"view = 0x{'f' * 5000}", "view = a whole number of 20000 bits", "a table"),
    "poly that explodes": (
        DVF + "[errors]\nEXX = { poly = [0, 1e308, 1e308] }",
        "errors.EXX",
        "±1000",
    ),
    "negative half width": (DVF + "tolerances.EAX = -1", "tolerances.EAX = -1", "at least 0"),
    "factor of zero": (DVF + "view.exaggeration = 0", "view.exaggeration = 0", "number above 0"),
    "direction of two": (LATHE + "direction.X = 2", "machine.direction.X = 2: expected 1 or -1"),
    "direction true": (LATHE + "direction.X = true", "machine.direction.X = true: expected 1 or"),
    # lists
    "point too short": (DVF + "points_mm.tool = [1, 2]", "points_mm.tool = [1, 2]", TRIPLE),
    "point too long": (
        LATHE + "offset_mm.X = [1, 2, 3, 4]",
        "machine.offset_mm.X = [1, 2,",
        TRIPLE,
    ),
    "trace too short": (
        DVF + "points_mm.traces = [[1, 2]]",
        "points_mm.traces[0] = [1, 2]",
        TRIPLE,
    ),
    "harmonic too short": (
        DVF + "[errors]\nEAC = { harmonics = [[1, 2]] }",
        "errors.EAC.harmonics[0] = [1, 2]: expected [order, amplitude, phase]",
    ),
    "empty poly": (DVF + "[errors]\nEAX = { poly = [] }", "errors.EAX.poly = []", "at least 1"),
    "empty table": (DVF + "[errors]\nEAX = { table = [] }", "errors.EAX.table = []", "at least 1"),
    "table not sorted": (
        DVF + "[errors]\nEAX = { table = [[1, 2], [0, 1]] }",
        "errors.EAX.table = [[1, 2], [0, 1]]: row 2 has position 0.0 after 1.0; expected ascending",
    ),
    "table with a position twice": (DVF + "[errors]\nEAX = { table = [[1, 2], [1, 3]] }", "row 2"),
    "empty range": (DVF + "workspace.X = [1, 1]", "workspace.X = [1, 1]", "with lower < upper"),
    "range upside down": (
        LATHE + "travel.X = [2, 1]",
        "machine.travel.X = [2, 1]",
        "lower < upper",
    ),
    "range of a rotary axis": (
        DVF + "workspace.C = [0, 90]",
        "workspace.C = [0, 90]",
        "one position",
    ),
    # functions
    "two functions": (DVF + "[errors]\nEAX = { ramp = 1, poly = [1] }", "errors.EAX.poly: unknown"),
    "no such function": (DVF + "[errors]\nEAX = { rmp = 1 }", "errors.EAX = { rmp = 1 }", FORMS),
    "curve for a constant": (DVF + "[errors]\nEC0Y = { ramp = 3 }", "errors.EC0Y = { ramp = 3 }"),
    "tolerance without width": (DVF + "tolerances.EAX.centre = 1", "EAX.half_width: is missing"),
    # chains
    "axis twice": ('[machine]\nchain = "wCXFXt"', "machine.chain", "has axis X twice"),
    "impossible chain": ('[machine]\nchain = "hello"', "chain 'hello' cannot be read", "wCBFXYZt"),
    "chain without axes": ('[machine]\nchain = "wFt"', "has no axis; expected one to eight"),
    "axis of no name": ('[machine]\nchain = "wFXYQt"', "unknown axis Q"),
    "no chain": ('[machine]\ntitle = "a"', "machine.chain: is missing"),
    # files
    "no TOML": ("= 1\n", "is not valid TOML", "line 1"),
    "key twice": (DVF + DVF, "is not valid TOML", "line 2"),
    "lists nested deeply": (DVF + f"title = {'[' * 99999}", "is not valid TOML: nested too deeply"),
    "keys nested deeply": (
        DVF + f"errors.EAX.{'a.' * 4}a = 1",
        "errors.EAX = { a = { a = ",
        FORMS,
    ),
    "key of many parts": (
        DVF + f"errors.EAX.{'a.' * 2000}a = 1",
        "line 2: a key of over 8 parts; expected at most 8",
    ),
    "factor too large": (
        DVF + "view.exaggeration = 1e7",
        "view.exaggeration = 10000000.0: expected at most 1,000,000",
    ),
    "factor too small": (
        DVF + "view.exaggeration = 5e-324",
        "view.exaggeration = 5e-324: expected at least 0.001",
    ),
    "tolerance too small": (
        DVF + "tolerances.EXX = 5e-324",
        "tolerances.EXX = 5e-324: expected 0, or at least",
    ),
    "error too small": (DVF + "errors.EXX = 5e-324", "errors.EXX = 5e-324: expected 0, or at"),
    "empty file": ("", "machine: is missing"),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_scene_is_refused_with_file_key_value_and_expectation(
    case, tmp_path: Path, warpspace
) -> None:
    text, *fragments = MALFORMED[case]
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    for command in ("check", "field"):
        warpspace(command, path, "--json").refused(f"warpspace: {path}: ", *fragments)
    assert list(tmp_path.iterdir()) == [path]


def test_all_problems_are_reported_at_once(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "many.toml"
    path.write_text(
        'machine = "dvf500"\ntitel = "x"\n[errors]\nEAXX = 1\nEBX = nan\n'
        "[workspace]\nX = [1, 0]\n[view]\nexaggeration = -1\n",
        encoding="utf-8",
    )
    warpspace("check", path).refused(
        "6 problems", "machine =", "titel", "EAXX", "EBX = nan", "workspace.X", "view.exaggeration"
    )


def test_thousands_of_problems_stay_readable(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "many.toml"
    lines = "".join(f"K{number} = 1\n" for number in range(20_000))
    path.write_text(f"{DVF}[errors]\n{lines}", encoding="utf-8")
    warpspace("check", path).refused("20000 problems", "… and 19960 more")


def test_huge_value_is_shown_in_a_line(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "huge.toml"
    path.write_text(f'{DVF}view.exaggeration = "{"y" * 1_000_000}"', encoding="utf-8")
    warpspace("check", path).refused("view.exaggeration", "…", '"auto" or a number above 0')


@pytest.mark.parametrize("size", [4 * 1024 * 1024 + 1, 1024**3])
def test_file_too_large_is_refused_unread(size: int, tmp_path: Path, warpspace) -> None:
    path = tmp_path / "large.toml"
    with path.open("wb") as file:
        file.truncate(size)
    warpspace("check", path).refused(str(path), f"is {size:,} bytes long", "at most 4,194,304")


def test_text_that_is_not_utf_8_is_refused(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "Fräse"\n'.encode("latin-1"))
    warpspace("check", path).refused(str(path), "is not UTF-8 text (byte 11)")


def test_byte_order_mark_is_accepted(tmp_path: Path, warpspace) -> None:
    path = tmp_path / "bom.toml"
    path.write_text(DVF, encoding="utf-8-sig")
    assert warpspace("check", path).status == 0


def test_folder_is_refused(tmp_path: Path, warpspace) -> None:
    warpspace("check", tmp_path).refused(str(tmp_path), "is a folder; expected a file")


def test_device_is_refused(warpspace) -> None:
    warpspace("check", "/dev/zero").refused("/dev/zero", "is no regular file")


@pytest.mark.parametrize("name", ["nowhere.toml", "", "x" * 5000])
def test_missing_file_is_refused_with_the_bundled_names(name: str, warpspace) -> None:
    warpspace("field", name).refused("no such scene or file", "dvf5000_first")


def test_misspelt_bundled_name_has_a_near_miss(warpspace) -> None:
    warpspace("check", "dvf5000_frist").refused("dvf5000_frist", "did you mean 'dvf5000_first'")
