"""Check the links of the built site: those inside it on disk, those outside over the network.

    python docs/_ext/check_links.py docs/_build/html [docs/_build/linkcheck/output.json]

Inside, every page, picture and anchor that is linked must exist; one that is missing ends with
status 1. Outside, what Sphinx's linkcheck has found is summed up: a page that answers "not found"
ends with status 1 too, one that could not be asked (no network, no answer) is listed and does not.
"""

import json
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

NO_PAGE = ("404", "410")
"""What a server answers where a page is gone."""


class Page(HTMLParser):
    """Anchors and links of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids, and what a tag refers to."""
        given = {key: value or "" for key, value in attrs}
        self.anchors |= {given[key] for key in ("id", "name") if key in given}
        if tag in {"a", "link"} and "href" in given:
            self.links.add(given["href"])
        if tag in {"img", "script", "iframe", "source"} and "src" in given:
            self.links.add(given["src"])


def broken_inside(site: Path) -> list[str]:
    """List the links that lead to nothing on disk.

    Parameters
    ----------
    site : Path
        The built pages.

    Returns
    -------
    list of str
        ``page: link``, sorted.
    """
    others = {site / "scenes", site / "_static"}  # offline scenes, and parts of the theme
    files = [path for path in site.rglob("*.html") if not others & set(path.parents)]
    pages = {path.resolve(): Page(path.read_text("utf-8")) for path in files}
    broken = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            known = pages.get(target)
            lost = not target.exists() or (
                parts.fragment and known and unquote(parts.fragment) not in known.anchors
            )
            if lost:
                broken.append(f"{path.relative_to(site.resolve())}: {link}")
    print(
        f"inside: {len(pages)} pages, {sum(len(p.links) for p in pages.values())} links,"
        f" {len(broken)} broken"
    )
    return sorted(broken)


def broken_outside(results: Path) -> list[str]:
    """List the outside links whose page is gone, and print how all fared."""
    rows = [json.loads(line) for line in results.read_text("utf-8").splitlines()]
    rows = [row for row in rows if row["uri"].startswith("http")]
    fine = [row for row in rows if row["status"] in {"working", "redirected"}]
    bad = [row for row in rows if row["status"] not in {"working", "redirected", "ignored"}]
    gone = [row for row in bad if any(code in row["info"].split()[:1] for code in NO_PAGE)]
    unasked = [row for row in bad if row not in gone]
    print(
        f"outside: {len(rows)} links, {len(fine)} answered, {len(gone)} gone,"
        f" {len(unasked)} could not be asked"
    )
    for row in unasked:
        print(f"  not asked: {row['uri']} ({row['filename']}:{row['lineno']}): {row['info'][:100]}")
    return [f"{row['filename']}:{row['lineno']}: {row['uri']}: {row['info']}" for row in gone]


def main() -> int:
    """Check what the arguments name."""
    lost = broken_inside(Path(sys.argv[1]))
    if len(sys.argv) > 2:
        lost += broken_outside(Path(sys.argv[2]))
    for line in lost:
        print(f"broken: {line}", file=sys.stderr)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
