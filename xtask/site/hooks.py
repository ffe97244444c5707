"""What mkdocs does to the HTML of each page: tables that fit their text and narrow screens, names
in code that break where they may, and a name for the search.
"""

from __future__ import annotations

import html as entities
import re

# Text longer than this (in characters) makes a column long, one of at most the second short.
LONG, SHORT = 40, 14

# Code up to this length stays on one line.
WHOLE = 24

# A table of at least three columns with more text than this in its longest row is shown row by row
# on narrow screens.
NARROW = 50

SEARCH = '<div class="md-search" data-md-component="search" role="dialog"'


def text_of(cell: str) -> str:
    """The text of some HTML."""
    return entities.unescape(re.sub(r"<[^>]*>", "", cell)).strip()


def cells_of(row: str) -> list[tuple[str, str, str]]:
    """Name, attributes and content of each cell."""
    return re.findall(r"<(t[hd])([^>]*)>(.*?)</\1>", row, re.DOTALL)


def width_name(length: int) -> str:
    return "long" if length > LONG else "short" if length <= SHORT else "middle"


def table(found: re.Match[str]) -> str:
    """A table whose cells know the width of their column and its heading."""
    rows = [cells_of(row) for row in re.findall(r"<tr>(.*?)</tr>", found[0], re.DOTALL)]
    count = max(map(len, rows), default=0)
    texts = [[text_of(content) for _, _, content in row] for row in rows]
    widths = [max(len(row[i]) for row in texts if i < len(row)) for i in range(count)]
    names = [width_name(width) for width in widths]
    labels = texts[0] if rows else []
    is_stacked = count > 2 and sum(widths) > NARROW

    def row_of(row: re.Match[str]) -> str:
        parts = []
        for (tag, attributes, content), label, name in zip(
            cells_of(row[1]), labels, names, strict=False
        ):
            # A heading without text would be announced as one.
            tag = "td" if tag == "th" and not text_of(content) and "<" not in content else tag
            label = entities.escape(label)
            is_labelled = is_stacked and tag == "td" and label
            data = f' data-label="{label}"' if is_labelled else ""
            role = {"th": ' role="columnheader"', "td": ' role="cell"'}[tag] if is_stacked else ""
            parts.append(f'<{tag}{attributes} class="{name}"{data}{role}>{content}</{tag}>')
        role = ' role="row"' if is_stacked else ""
        return f"<tr{role}>\n" + "\n".join(parts) + "\n</tr>"

    text = re.sub(r"<tr>(.*?)</tr>", row_of, found[0], flags=re.DOTALL)
    # Material's style sheet is for tables without a class.
    return text.replace("<table>", '<table data-stacked role="table">', 1) if is_stacked else text


def code(found: re.Match[str]) -> str:
    """Code within text: whole if it is short, else with places to break."""
    if found[1]:
        return found[0]
    content = found[2]
    if len(text_of(content)) <= WHOLE:
        return f'<code class="whole">{content}</code>'
    parts = re.split(r"(<[^>]*>|&[^;]*;)", content)
    parts[::2] = [re.sub(r"([/_.=,]|::)(?=\w)", r"\1<wbr>", part) for part in parts[::2]]
    return f"<code>{''.join(parts)}</code>"


def command(found: re.Match[str]) -> str:
    """A block of commands whose options are not broken at their hyphens."""
    parts = re.split(r"(<[^>]*>|&[^;]*;)", found[0])
    parts[::2] = [
        re.sub(r"(?<![\w-])--?[a-zA-Z][\w-]*", r'<span class="whole">\g<0></span>', part)
        for part in parts[::2]
    ]
    return "".join(parts)


def on_page_content(html: str, **_: object) -> str:
    html = re.sub(r"<table>.*?</table>", table, html, flags=re.DOTALL)
    html = re.sub(r'<div class="language-sh .*?</div>', command, html, flags=re.DOTALL)
    return re.sub(r"(<pre>.*?</pre>)|<code>(.*?)</code>", code, html, flags=re.DOTALL)


def on_post_page(output: str, **_: object) -> str:
    return output.replace(SEARCH, f'{SEARCH} aria-label="Search"')


def on_post_template(output_content: str, **_: object) -> str:
    """The page for errors is a template of the theme."""
    return on_post_page(output_content)
