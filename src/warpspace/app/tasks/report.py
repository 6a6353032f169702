"""The report's window: author and open questions, what stands in it, and the file."""

from functools import partial

from markupsafe import Markup

from warpspace.analysis.description import Result
from warpspace.app.browser.html import button, field, join, tag, text_box
from warpspace.app.browser.incoming import index_of
from warpspace.app.documents.files import has_sheet
from warpspace.app.documents.services import Report
from warpspace.app.evaluation.live_picture import LivePicture
from warpspace.app.state.app_state import AppState
from warpspace.app.tasks.context import Context
from warpspace.app.tasks.files import JobWindow
from warpspace.app.tasks.jobs import Job
from warpspace.app.tasks.window import actions

REPORT_S = 12.0  # what it usually takes
LONGEST_AUTHOR, LONGEST_QUESTIONS = 120, 4000  # characters
ALWAYS = (
    "the verdict with the limit, and the error map",
    "statistics, sections and slices of the volume",
    "the contribution of each error at the worst point",
    "the adjustments that help most",
    "errors, tolerances, and the errors that the tolerances allow",
    "error gains, conventions, provenance",
)


class ReportWindow(JobWindow):
    """Writes the design review of what is drawn."""

    name, title = "report", "Report"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self._author, self._questions = "", ""

    def body(self, picture: LivePicture) -> Markup:
        found = picture.compared
        subject = (
            f"It compares A, {found.titles[0]}, with B, {found.titles[1]}."
            if found is not None and has_sheet(picture)
            else f"It is about {picture.title}, as drawn now."
        )
        limit = f"{picture.state.specification.limit_um:g} µm"
        author = text_box("report:set.author", self._author, placeholder="Name")
        questions = tag("textarea", self._questions, id="ws-report-set-questions", class_="ws-box",
                        data_set="report:set.questions", placeholder="One per line")  # fmt: skip
        put = [
            tag("li", join((f"{title} ", button("remove", "report:remove", index, kind="link"))))
            for index, (title, _) in enumerate(self.context.reported)
        ]
        hint = "More results are added with the button “Add to report” below each of them."
        return join((
            tag("p", f"{subject} Limit: {limit}."),
            field("Author", author, "report:set.author"),
            field("Open questions", questions, "report:set.questions"),
            actions(button("Write HTML", "report:write", ".html", kind="main",
                           hint="One page with a rotatable view; needs no network"),
                    button("Write PDF", "report:write", ".pdf", hint="For paper")),
            self._jobs.html(),
            tag("h3", "Contents"),
            tag("ul", join((*(tag("li", words) for words in ALWAYS), *put))),
            tag("p", hint, class_="ws-quiet"),
        ))  # fmt: skip

    def take(self, state: AppState, word: str, value: str) -> AppState:
        if word == "set.author":
            self._author = value[:LONGEST_AUTHOR]
        elif word == "set.questions":
            self._questions = value[:LONGEST_QUESTIONS]
        elif word == "remove":
            index = index_of(value, len(self.context.reported))
            if index is not None:
                del self.context.reported[index]
                self.context.act(partial(self.context.renew, self))
        elif word == "write" and value in (".html", ".pdf"):
            self.context.act(partial(self._write, value))
        return super().take(state, word, value)

    def _write(self, ending: str) -> None:
        asked = [line.strip() for line in self._questions.splitlines() if line.strip()]
        results: dict[str, Result] = {}
        for index, (title, found) in enumerate(self.context.reported):
            results[f"{title} ({index + 1})" if title in results else title] = found
        about = Report(self._author.strip(), tuple(asked), results, ending)

        def write(picture: LivePicture, job: Job) -> bytes:
            content, missing = self.context.services.write_report(picture, about, job)
            if missing and not job.is_set():
                self.context.notify("Some figures are missing", "\n".join(missing), "warning")
            return content

        self.make("Report", f"_report{ending}", REPORT_S, write)
