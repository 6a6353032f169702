"""The Markdown pages of the project, and what stands in them."""

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BUILT = ("_build", "gallery", "generated")


def pages() -> list[Path]:
    below = [path for path in DOCS.rglob("*.md") if not set(BUILT) & set(path.parts)]
    return sorted([*below, *(ROOT / name for name in ("README.md", "CONVENTIONS.md"))])


def blocks(text: str, language: str) -> list[str]:
    found = re.findall(
        rf"^```{re.escape(language)}[^\n]*\n(.*?)^```", text, re.DOTALL | re.MULTILINE
    )
    return [str(block) for block in found]


def prose(text: str) -> str:
    return re.sub(r"^(```|:::+).*?^\1", "", text, flags=re.DOTALL | re.MULTILINE)


def slug(heading: str) -> str:
    plain = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return plain.replace(" ", "-")


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", prose(page.read_text("utf-8")), re.MULTILINE)
    return {slug(heading) for heading in headings}


def links(page: Path) -> Iterator[tuple[str, str]]:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page.read_text("utf-8"))):
        if "://" not in target:
            file, _, anchor = target.partition("#")
            yield file, anchor


def entries(page: Path) -> Iterator[str]:
    """Give the entries of the tables of contents of a page."""
    for block in blocks(page.read_text("utf-8"), "{toctree}"):
        for line in block.splitlines():
            if line and not line.startswith(":"):
                titled = re.fullmatch(r".+ <(.+)>", line)
                yield titled.group(1) if titled else line


def section(page: Path, heading: str) -> str | None:
    found = re.search(
        rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)",
        page.read_text("utf-8"),
        re.DOTALL | re.MULTILINE,
    )
    return None if found is None else found.group(1)
