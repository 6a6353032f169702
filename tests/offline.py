"""A page from a file in a browser without a network: what it asks for, and that it draws."""

from contextlib import contextmanager

import pytest

from app.frames import pixels_of_the_map

EVIL = "</script><script>window.hacked=1</script><img src=x onerror='window.hacked=2'>&\"'"
"""A title that would run as a script where a page does not escape it."""


@contextmanager
def opened_offline(browser, path):
    context = browser.new_context(viewport={"width": 1440, "height": 900}, offline=True)
    page = context.new_page()
    requests: list[str] = []
    problems: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda entry: problems.append(entry.text) if entry.type == "error" else None)
    page.goto(path.as_uri())
    yield page
    assert page.evaluate("window.hacked") is None
    assert problems == []
    own = [url for url in requests if not url.startswith(("blob:", "data:", "about:"))]
    assert own == [path.as_uri()]
    context.close()


def wait_for_the_map(page, canvas, least):
    canvas.wait_for(state="visible", timeout=120_000)
    for _ in range(240):  # software rendering beside other programs
        if pixels_of_the_map(canvas.screenshot()) > least:
            return
        page.wait_for_timeout(500)
    pytest.fail("the map is not drawn")
