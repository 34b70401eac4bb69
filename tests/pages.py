"""Pages of reports as a browser would read them."""

import base64
from html.parser import HTMLParser


class Reader(HTMLParser):
    """Collects tags, attributes and text, and insists that every tag is closed."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self):
        super().__init__()
        self.tags, self.text, self.open = [], "", []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def read_page(path):
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    assert reader.open == []
    return reader


def assert_needs_nothing_else(reader):
    """No script, and nothing fetched from anywhere."""
    assert not {"script", "iframe", "object", "embed", "base"} & {tag for tag, _ in reader.tags}
    for _, attributes in reader.tags:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            assert (attributes.get(name) or "#").startswith(("#", "data:"))
        assert not any(name.startswith("on") for name in attributes)
    assert "@import" not in reader.text and "url(" not in reader.text


def embedded(reader):
    """The bytes of every picture of the page."""
    sources = [attributes["src"] for attributes in reader.of("img")]
    return [base64.b64decode(source.removeprefix("data:image/png;base64,"), validate=True) for source in sources]
