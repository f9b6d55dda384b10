"""A Markdown report as one HTML file that needs nothing beside it."""

import base64
from html import escape
from pathlib import Path

from markdown_it import MarkdownIt

_STYLE = """\
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem; font: 16px/1.5 system-ui, sans-serif; color: #222; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { padding: 0.25rem 0.75rem; border-bottom: 1px solid #ddd; text-align: left; }
img { max-width: 100%; }
pre { background: #f4f4f4; padding: 0.75rem; overflow-x: auto; }
"""


def page_of(markdown: str, folder: Path) -> str:
    """The page, with the PNGs that the text names by their path in `folder` inside it."""
    parser = MarkdownIt("commonmark").enable("table")
    tokens = parser.parse(markdown)
    for token in tokens:
        for child in token.children or ():
            if child.type == "image":
                picture = (folder / str(child.attrs["src"])).read_bytes()
                child.attrs["src"] = "data:image/png;base64," + base64.b64encode(picture).decode()
    body = parser.renderer.render(tokens, parser.options, {})
    title = escape(markdown.splitlines()[0].lstrip("# "))
    head = f'<meta charset="utf-8">\n<title>{title}</title>\n<style>\n{_STYLE}</style>'
    return f'<!doctype html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}</body>\n</html>\n'
