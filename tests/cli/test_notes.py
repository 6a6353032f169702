"""Review notes on the command line: listed, added and merged; hostile texts do nothing."""

import csv
import re
import subprocess
import sys
import tomllib

import pytest

from warpspace import load_scene
from warpspace.cli import note_editing
from warpspace.scene.library import scene_path

CORNER = {"X": 275.0, "Y": -225.0, "Z": -480.0}
NOTE = 'id = "a1"\ntext = "x"\ndate = 2026-11-22T10:00:00Z\n'
VERSION = '{ id = "b2", text = "x", date = 2026-11-22T10:00:00Z }'
HOSTILE = (
    '=HYPERLINK("http://evil")', "+1", "-1+2", "@SUM(1)", "\t=1", "<script>alert(1)</script>",
    "[here](javascript:alert(1))", "# heading", "- item", "1. item", "| a | b |", "**bold** `code`",
    "![x](http://evil/x.png)", "two\nlines", "=====", "&lt;b&gt;",
)  # fmt: skip


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(scene_path("dvf5000_first").read_text("utf-8"), encoding="utf-8")
    return path


def test_a_note_is_added_with_its_numbers_and_the_file_stays_as_written(warpspace, mine):
    before = mine.read_text("utf-8")
    added = warpspace(
        "notes", mine, "--add", "Shim?", "--at", "X=275,Y=-225,Z=-480", "--kind", "question",
        "--author", "R. Roe", "--step", 2,
    )  # fmt: skip
    assert added.status == 0
    assert mine.read_text("utf-8").startswith(before)
    (note,) = load_scene(mine).review
    assert (note.kind, note.text, note.author, note.step) == ("question", "Shim?", "R. Roe", 2)
    assert note.at == CORNER
    assert note.numbers == {"mean_um": 30.89, "max_um": 51.72, "here_um": 51.72}
    listed = warpspace("notes", mine, "--json").json["notes"]
    (checked,) = warpspace("check", mine, "--json").json["notes"]
    assert checked.items() >= {"id": note.id, "stale": False, "now": note.numbers}.items()
    assert checked.items() <= listed[0].items()
    assert listed[0]["text"] == "Shim?"
    assert "R. Roe" in warpspace("notes", mine).out


def test_a_note_is_marked_where_its_numbers_no_longer_hold(warpspace, mine):
    warpspace("notes", mine, "--add", "Shim?")
    text = mine.read_text("utf-8")
    mine.write_text(text.replace("EA0Z = 33.9", "EA0Z = 30.0"), encoding="utf-8")
    assert "changed: 51.7 → 46.1" in " ".join(warpspace("notes", mine).out.split())
    (note,) = warpspace("check", mine, "--json").json["notes"]
    assert (note["stale"], note["now"]["max_um"]) == (True, 46.09)
    assert tomllib.loads(mine.read_text("utf-8"))["notes"][0]["numbers"]["max_um"] == 51.72


def test_hostile_texts_do_nothing(warpspace, mine, tmp_path):
    for text in HOSTILE:
        author = " ".join(text.split())[:100]  # one line, as it has to be
        assert warpspace("notes", mine, "--add", text, "--author", author).status == 0, text
    assert [one.text for one in load_scene(mine).review] == [*HOSTILE]
    warpspace("notes", mine, "-o", tmp_path / "notes.csv")
    rows = [*csv.reader((tmp_path / "notes.csv").read_text("utf-8").splitlines())]
    assert len(rows) == 1 + len(HOSTILE)
    assert {len(row) for row in rows} == {len(rows[0])}
    assert not [cell for row in rows for cell in row if cell[:1] in ("=", "+", "-", "@", "\t")]
    warpspace("notes", mine, "-o", tmp_path / "notes.md")
    written = (tmp_path / "notes.md").read_text("utf-8")
    # all marks stand behind a backslash, besides those of the heading and between the cells
    title, _, *lines = written.splitlines()
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in lines} == {7}
    assert len(lines) == 2 + len(HOSTILE)
    assert not re.findall(r"(?<!\\)[<>`*\[\]#!&~_]", "".join([title[1:], *lines]))


def test_an_output_that_does_not_belong_is_refused(warpspace, mine, tmp_path):
    add = ("notes", "dvf5000_first", "--add", "x")
    warpspace(*add).refused("bundled", "-o FILE.toml")
    warpspace(*add, "-o", tmp_path / "notes.csv").refused("expected a .toml file")
    warpspace("notes", mine, "-o", tmp_path / "new.toml").refused("need --add")
    warpspace("notes", mine, "--at", "X=1").refused("need --add")
    assert warpspace(*add, "-o", tmp_path / "new.toml").status == 0
    warpspace(*add, "-o", tmp_path / "new.toml").refused("--force")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (["x" * 2001], "expected at most 2000 characters"),
        ([""], "text"),
        (["\x1b[31mred"], "without control characters"),
        (["\x9b31mred"], "without control characters"),
        (["half a \udcff byte"], "without control characters"),
        (["x", "--at", "Q=1"], "unknown axis Q"),
        (["x", "--step", "-1"], "expected at least 0"),
        (["x", "--author", "x" * 101], "expected at most 100 characters"),
    ],
)
def test_a_note_that_cannot_be_is_refused_and_the_file_stays(warpspace, mine, text, said):
    before = mine.read_bytes()
    warpspace("notes", mine, "--add", *text).refused(said)
    assert mine.read_bytes() == before


def test_a_scene_is_not_written_where_the_files_beside_it_are_missing(warpspace, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "pitch.csv").write_text("X,pitch\n0,1\n10,2\n")
    text = 'machine = "dvf5000"\n[errors]\nEBX = { csv = "pitch.csv", column = "pitch" }\n'
    (tmp_path / "a.toml").write_text(text)
    add = ("notes", tmp_path / "a.toml", "--add", "x", "-o")
    warpspace(*add, tmp_path / "there/b.toml").refused("pitch.csv")
    assert warpspace(*add, tmp_path / "b.toml").status == 0


@pytest.mark.parametrize(
    ("notes", "said"),
    [
        (f"[[notes]]\n{NOTE}" * 2, "another note has this id"),
        (f"[[notes]]\n{NOTE}colour = 1\n", "notes[0].colour: unknown key"),
        ('[[notes]]\nid = "a1"\ntext = "x"\n', "notes[0].date: is missing"),
        (f"[[notes]]\n{NOTE}".replace("Z\n", "\n"), "expected a time with its zone"),
        (f"[[notes]]\n{NOTE}".replace('"a1"', '"A/1"'), "small letters and digits"),
        (f"[[notes]]\n{NOTE}at = {{ W = 1 }}\n", "notes[0].at.W: unknown axis of this machine"),
        (f"[[notes]]\n{NOTE}on = {{ body = 'V' }}\n", "unknown body"),
        (f"[[notes]]\n{NOTE}change = {{ EQQ = [1, 2] }}\n", "unknown error parameter"),
        (f"[[notes]]\n{NOTE}change = {{ EXX = [1] }}\n", "expected [from, to]"),
        (f"[[notes]]\n{NOTE}numbers = {{ max_um = nan }}\n", "notes[0].numbers.max_um"),
        (f"[[notes]]\n{NOTE}step = 'x'\n", "notes[0].step = \"x\": expected a number"),
        (f"[[notes]]\n{NOTE}step = 2.5\n", "expected a whole number"),
        (f"[[notes]]\n{NOTE}kind = 'order'\n", 'expected one of "note", "question", "decision"'),
        (f"[[notes]]\n{NOTE}replies = [{{ text = 'x' }}]\n", "notes[0].replies[0].date"),
        (f"[[notes]]\n{NOTE}versions = [{VERSION}]\n", "expected versions of a1"),
        ("".join(f"[[notes]]\n{NOTE}".replace("a1", f"a{n}") for n in range(501)), "at most 500"),
        ("notes = 3\n", "notes"),
    ],
)  # fmt: skip
def test_notes_of_a_file_that_cannot_be_are_named(warpspace, tmp_path, notes, said):
    path = tmp_path / "bad.toml"
    path.write_text(f'machine = "dvf5000"\n{notes}')
    warpspace("check", path).refused(said)


def test_two_files_are_merged_and_what_both_edited_is_said(warpspace, tmp_path):
    def scene(name, text, more=""):
        path = tmp_path / f"{name}.toml"
        head = scene_path("dvf5000_first").read_text("utf-8")
        note = NOTE.replace('"x"', f'"{text}"')
        path.write_text(f'{head}\n[[notes]]\n{note}replaces = ["0"]\n{more}', encoding="utf-8")
        return path

    own = f"[[notes]]\n{NOTE}".replace("a1", "b2")
    mine, yours = scene("mine", "mine"), scene("yours", "yours", own)
    merged = warpspace("merge", mine, yours, "-o", tmp_path / "both.toml")
    assert merged.status == 0
    assert "2 notes of 1 and 2" in " ".join(merged.out.split())
    assert "a1: 2 versions, both retained" in " ".join(merged.out.split())
    assert merged.err == ""
    first, second = load_scene(tmp_path / "both.toml").review
    assert {first.text, first.versions[0].text} == {"mine", "yours"}
    assert second.id == "b2"
    warpspace("merge", yours, mine, "-o", tmp_path / "other.toml")
    assert (tmp_path / "other.toml").read_bytes() == (tmp_path / "both.toml").read_bytes()
    warpspace("merge", mine, yours, "-o", mine).refused("mine.toml")


def test_a_merge_says_what_else_differs_and_refuses_notes_that_do_not_fit(
    warpspace, mine, tmp_path
):
    other = tmp_path / "other.toml"
    text = mine.read_text("utf-8").replace("EA0Z = 33.9", "EA0Z = 30.0")
    other.write_text(text, encoding="utf-8")
    merged = warpspace("merge", mine, other, "-o", tmp_path / "both.toml")
    assert "among them the errors EA0Z" in merged.err
    other.write_text(f'machine = "gantry_mill"\n[[notes]]\n{NOTE}at = {{ A = 1 }}\n')
    warpspace("merge", mine, other, "-o", tmp_path / "none.toml").refused("notes[0].at")
    assert not (tmp_path / "none.toml").exists()


def test_notes_that_are_added_at_once_are_all_stored(mine):
    texts = [f"note {number}" for number in range(5)]
    command = (sys.executable, "-m", "warpspace", "notes", mine, "--add")
    started = [subprocess.Popen((*command, text)) for text in texts]
    assert [process.wait(60) for process in started] == [0] * len(texts)
    assert {note.text for note in load_scene(mine).review} == {*texts}
    assert list(mine.parent.iterdir()) == [mine]


def test_a_note_replaces_no_edit_made_while_it_was_computed_and_no_link(
    warpspace, mine, monkeypatch
):
    link = mine.with_name("link.toml")
    link.symlink_to(mine)
    assert warpspace("notes", link, "--add", "first").status == 0
    assert link.is_symlink()
    compute = note_editing.note_numbers

    def edit_meanwhile(scene, review):
        mine.write_text(mine.read_text("utf-8") + "# edited\n", encoding="utf-8")
        return compute(scene, review)

    monkeypatch.setattr(note_editing, "note_numbers", edit_meanwhile)
    warpspace("notes", mine, "--add", "second").refused("has changed since it was read")
    assert mine.read_text("utf-8").endswith("# edited\n")
    assert [note.text for note in load_scene(mine).review] == ["first"]
