"""A small count of every row of docs/reliability.md, and the table itself."""

import random
import re
import sys
from pathlib import Path

import pytest

from reliability import lines, reading, rows
from reliability.comments import CONTROLS, fault_of, writers
from reliability.formats import EVERY, WORDS, Format
from reliability.proxy import nginx_is_there
from warpspace.exceptions import OptionError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forks, limits and signals")


NIGHTLY = pytest.mark.nightly
NGINX = pytest.mark.skipif(not nginx_is_there(), reason="needs nginx and openssl")


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("files", 100),
        ("scenes", 100),
        pytest.param("programs", 100, marks=NIGHTLY),
        pytest.param("comments", 300, marks=NIGHTLY),
        pytest.param("lines", 500, marks=NIGHTLY),
        pytest.param("kills", 8, marks=NIGHTLY),
        pytest.param("updates", 8, marks=NIGHTLY),
        ("sets", 30),
        pytest.param("messages", 3000, marks=NIGHTLY),
        pytest.param("surroundings", 8, marks=NIGHTLY),
        pytest.param("soak", 1, marks=NIGHTLY),
        pytest.param("doors", 1200, marks=NIGHTLY),  # every file that is built to exhaust
        pytest.param("proxy", 20, marks=[NIGHTLY, NGINX]),
        pytest.param("failing states", 66, marks=NIGHTLY),
    ],
)
def test_a_small_count_of_a_row_holds(name, count):
    outcome = rows.ROWS[name].run(count)
    assert outcome.faults == []
    assert outcome.count == count


def fail(content, folder):
    raise IndexError(content)


def refuse(content, folder):
    raise OptionError("x: expected y")


@pytest.mark.parametrize(
    ("read", "said"),
    [(fail, "IndexError"), (refuse, ""), (lambda *_: sum(range(500_000)), "s of CPU")],
    ids=["traceback", "message", "hang"],
)
def test_a_traceback_and_a_hang_are_faults_and_a_message_is_none(read, said, tmp_path, monkeypatch):
    if said == "s of CPU":
        monkeypatch.setattr(reading, "LONGEST_S", 0.001)
    reader = reading.Reader(tmp_path)
    reader._formats = {"mine": Format("mine", lambda: [b"x"], read)}
    reader.read("mine", b"x")
    assert [said in fault for fault in reader.faults] == [True] * bool(said)
    for fault in reader.faults:
        Path(re.findall(r"\((/[^)]*)\)$", fault)[0]).unlink()


@pytest.mark.parametrize("name", writers())
def test_no_control_character_of_a_title_gets_into_the_files_of_a_format(name):
    for some in (CONTROLS[::2], CONTROLS[1::2]):
        assert fault_of(name, "".join(some)) == ""


WORST = {
    "csv": (b"X,error\n", b"1", b"x\n"),
    "test": (b"run,direction,target_mm,deviation_um\n1,+,", b"1", b"x,0\n"),
    "readings": (b"x_mm [", b" ", b"\n"),
    "stl": (b"solid a\nvertex 0 0 0\nendsolid a ", b"endsolid ", b""),
    "obj": (b"v 0 0 ", b"1", b"x\n"),
    "ply": (b"ply\nformat ascii 1.0\ncomment ", b" ", b"x\nend_header\n"),
    "urdf": (b'<robot name="r"><link name="', b"a ", b'"/>'),
    "link": (b"", b"a", b"!"),
    "scene": (b"title = '", b"a", b"\n"),
    "measured": (b"X [", b" ", b"\n"),
    "import csv": (b"%% x.csv\nX [", b" ", b"\n1\n"),
    "import rtl": (b"%% x.rtl\nHEADER::\nTARGET DATA::\na", b" ", b"x\n"),
    "import klipper": (b"%% x.cfg\n[skew_correction", b" ", b"x\n"),
    "import marlin": (b"%% x.gcode\nM852 I", b"1", b"x\n"),
    "import linuxcnc-comp": (b"%% x_X.comp\n", b"1", b"x 1 1\n"),
    "import linuxcnc-matrix": (b"%% x.hal\nsetp matrixkins.C_xx ", b"1", b"x\n"),
    "import sinumerik-enc": (b"%% x.ini\n$AA_ENC_COMP[0,0,X", b" ", b"\n"),
    "import sinumerik-cec": (b"%% x.ini\n$AN_CEC[0,0]=", b"1", b"x\n"),
    "import heidenhain": (b"%% x_X.com\nBEGIN X MM\nNR AXISPOS X\n0 ", b"1", b"x 0\n[END]\n"),
    "import fanuc-3d": (b"%% x.csv\n# three-dimensional error compensation\n", b"1", b"x\n"),
    "import iso-text": (b"%% x.txt\n[EXX]\nVALUE = ", b"1", b"x\n"),
    "import isg-csv": (b"%% x.csv\nX;EXX\n", b"1", b"x;1\n"),
    "program": (b"G1 X", b"1", b"#\n"),
}
"""Beginning, piece that is repeated, and end of a line that a careless parser is slow with."""


@pytest.mark.parametrize(
    "each", [one for one in EVERY if one.name in WORST], ids=lambda one: one.name
)
def test_the_worst_line_of_a_parser_takes_time_in_proportion_to_its_length(each, tmp_path):
    head, piece, tail = WORST[each.name]

    def make(length):
        return head + piece * (length // len(piece)) + tail

    found = lines.growth(lambda content: each.read(content, tmp_path), make, 4_000, 16_000)
    assert found <= lines.STEEPEST


@pytest.mark.parametrize(
    ("name", "head", "piece"),
    [
        ("import isg-csv", b"%% x.csv\n", b"A "),
        ("import csv", b"%% x.csv\n", b"X,"),
        ("readings", b"", b"x_mm,"),
    ],
)
def test_equal_columns_are_refused_in_proportion_to_their_number(name, head, piece, tmp_path):
    (each,) = (one for one in EVERY if one.name == name)

    def make(length):
        return head + piece * (length // len(piece)) + b"x\n1\n"

    found = lines.growth(lambda content: each.read(content, tmp_path), make, 4_000, 16_000)
    assert found <= lines.STEEPEST


@pytest.mark.nightly
def test_many_blank_lines_are_passed_over_in_proportion_to_their_number(tmp_path):
    for each in EVERY:
        seed = each.seeds()[-1]

        def make(count, seed=seed):
            at = seed.find(b"\n") + 1
            return seed[:at] + b"\n" * count + seed[at:]

        found = lines.growth(lambda text: each.read(text, tmp_path), make, 12_500, 50_000)  # noqa: B023
        assert found <= lines.STEEPEST, each.name


@pytest.mark.parametrize("each", EVERY, ids=lambda each: each.name)
def test_files_are_read_as_they_are_and_changed_ones_get_past_the_first_check(each, tmp_path):
    reader, chance, seeds = reading.Reader(tmp_path), random.Random(3), each.seeds()
    for content in seeds:
        if b"\0" * 80 + b"\0\0\0\x80" not in content[:84]:  # says that it is longer
            assert each.read(content, tmp_path) is not None
    for count in range(1, 401):
        reader.read(
            each.name, reading.mutate(seeds, [*WORDS, *each.words] if each.text else [], chance)
        )
        if 0 < reader.good[each.name] < count:  # some are refused, and some are read
            break
    assert reader.faults == []
    assert 0 < reader.good[each.name] < 400


def test_every_row_is_described_on_the_page():
    text = rows.PAGE.read_text("utf-8")
    outcome = rows.Outcome(7, "a | b", [])
    for name in rows.ROWS:
        assert re.search(rf"\b{name}\b", text.partition("What the rows do")[2]), name
        assert text.count(f"\n| `{name}` | ") == 1
        text = rows.put_row(text, name, outcome, "2026-01-02")
    assert text.count("| 2026-01-02 | held: a \\| b |\n") == len(rows.ROWS)
