"""A job's page as a reader has it: well-formed, with nothing fetched from elsewhere."""

import html.parser
import re
import shlex
from pathlib import Path

_VOID = {"meta", "img", "br", "hr", "link"}


class _Reader(html.parser.HTMLParser):
    """Texts, headings and addresses of a page; tags that are not closed in order are refused."""

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.ids = [], [], set()
        self.texts, self.headings, self.pictures = [], [], 0

    def handle_starttag(self, tag, attributes):
        assert tag not in ("script", "iframe", "link", "object")
        given = dict(attributes)
        self.addresses += [given[key] for key in ("src", "href", "action") if key in given]
        self.pictures += tag == "img"
        if "id" in given:
            assert given["id"] not in self.ids
            self.ids.add(given["id"])
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style",):
            self.texts.append(data)
        if self.open and self.open[-1] == "h2":
            self.headings.append(data.partition(". ")[2])


def read(path: Path) -> _Reader:
    """A page that holds all it shows."""
    page = path.read_text(encoding="utf-8")
    reader = _Reader()
    reader.feed(page)
    reader.close()
    assert reader.open == []
    for address in reader.addresses:
        assert address.startswith("data:image/") or address[1:] in reader.ids, address[:60]
    # Beside what is within pictures no address at all.
    rest = re.sub(r"data:image/[^\"]*", "", page)
    assert not re.search(r"https?:|url\(|@import", rest)
    assert len(page) < 3e6
    return reader


def text(path: Path) -> str:
    """The texts of such a page, one after the other."""
    return " ".join(" ".join(read(path).texts).split())


def arguments(path: Path, job: str) -> list[str]:
    """The arguments of the command that the page says."""
    (line,) = re.findall(rf"python -m optimize\.{job} [^\n]*", "\n".join(read(path).texts))
    return shlex.split(line)[3:]
