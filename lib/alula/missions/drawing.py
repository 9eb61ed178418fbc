"""Draws a mission's tree as SVG and as text, in the signs of the paper's Figures 6, 7 and 10.

Skills are green, internal actions grey, a sequence is an arrow, a selector a question mark, a parallel a purple trapezium.
A node a line, children indented below their parent, top to bottom in the order in which they are ticked: so a deep tree with
many leaves stays readable. The frame's colour and the words at the right tell how each node ended; of a mission that is a file,
ports and conditions follow as the file has them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from html import escape

from alula.trees.view import NodeView

ROW_PX = 31
BOX_PX = 24
INDENT_PX = 30
LETTER_PX = 6.6
MARGIN_PX = 16
TITLE_PX = 34
NOTE_LETTERS = 160  # of a note beside its node, and of its ports; the record has all of it
GAP_PX = 12
TITLE_LETTER_PX = 9.6
GAP = "\N{EN SPACE}"  # a picture shows several spaces as one
FONT = "font-family='DejaVu Sans, Helvetica, sans-serif'"

SYMBOLS = {
    "sequence": "\N{RIGHTWARDS ARROW}",
    "selector": "?",
    "parallel": "\N{RIGHTWARDS PAIRED ARROWS}",
    "decorator": "\N{WHITE DIAMOND}",
    "control": "\N{CIRCLED RING OPERATOR}",
    "subtree": "\N{DOWNWARDS ARROW WITH TIP RIGHTWARDS}",
}
FILLS = {
    "skill": "#b7e1b0",
    "action": "#d9d9d9",
    "condition": "#eef3f8",
    "sequence": "#ffffff",
    "selector": "#ffffff",
    "parallel": "#d9c4ec",
    "decorator": "#fff7e0",
    "control": "#ffffff",
    "subtree": "#e3eefb",
}
STROKES = {"SUCCESS": "#2e8b40", "FAILURE": "#c62828", "RUNNING": "#1565c0", "INTERRUPTED": "#7a7a7a", "INVALID": "#bdbdbd"}
MARKS = {"SUCCESS": "\N{CHECK MARK}", "FAILURE": "\N{BALLOT X}", "RUNNING": "\N{HORIZONTAL ELLIPSIS}", "INTERRUPTED": "interrupted"}
PORTS_INK, CONDITIONS_INK = "#5d6b78", "#9a5b00"
NEW_FILL, NEW_WORDS = "#fdf1c7", "new"


class _Canvas:
    """Collects shapes, a line a node."""

    def __init__(self, new: Collection[int]) -> None:
        self._new = new
        self.parts: list[str] = []
        self.width = 0.0
        self.rows = 0

    def node(self, view: NodeView, x: float) -> float:
        """Draw a node and what is below it; return the middle of its line."""
        y = TITLE_PX + MARGIN_PX + (self.rows + 0.5) * ROW_PX
        if self.rows in self._new:
            self.parts.append(f"<rect x='0' y='{y - ROW_PX / 2:.1f}' width='100%' height='{ROW_PX}' fill='{NEW_FILL}'/>")
        self.rows += 1
        self._box(view, x, y)
        stem = x + INDENT_PX / 2
        for child in view.children:
            child_y = self.node(child, x + INDENT_PX)
            self.parts.append(f"<path d='M{stem:.1f} {y + BOX_PX / 2:.1f} V{child_y:.1f} H{x + INDENT_PX:.1f}' fill='none' stroke='#999'/>")
        return y

    def _box(self, view: NodeView, x: float, y: float) -> None:
        label, stroke = _label(view), STROKES[view.status]
        width = len(label) * LETTER_PX + 22
        style = f"fill='{FILLS[view.kind]}' stroke='{stroke}' stroke-width='{1 if view.status == 'INVALID' else 2}'"
        place = view.source.place if view.source else ""
        hint = " ".join(filter(None, (view.skill or view.name, view.status, view.message, place)))
        ink = "#9a9a9a" if view.status == "INVALID" and view.source is None else "#111"
        self.parts += (
            f"<g><title>{escape(hint)}</title>{_shape(view.kind)(x, y - BOX_PX / 2, width, style)}",
            f"<text x='{x + width / 2:.1f}' y='{y + 4:.1f}' text-anchor='middle' fill='{ink}'>{escape(label)}</text></g>",
        )
        after = x + width + 10
        for words, colour in ((_note(view), stroke), (_ports(view), PORTS_INK), (_conditions(view), CONDITIONS_INK)):
            if words:
                self.parts.append(f"<text x='{after:.1f}' y='{y + 4:.1f}' fill='{colour}'>{escape(words)}</text>")
                after += len(words) * LETTER_PX + GAP_PX
        self.width = max(self.width, after)


def _label(view: NodeView) -> str:
    symbol = SYMBOLS.get(view.kind, "")
    kind = view.skill.rpartition(".")[2] or (view.source.type if view.source else "")
    name = f"{view.name} ({kind})" if kind and view.name not in {kind, view.skill} else view.name
    return f"{symbol} {name}" if symbol else name


def _note(view: NodeView) -> str:
    mark = MARKS.get(view.status, "")
    worth_it = view.message and view.message != mark and view.status != "INVALID"
    return _cut(f"{mark} {view.message}".strip() if worth_it else mark)


def _ports(view: NodeView) -> str:
    return _cut(GAP.join(f"{name}={text}" for name, text in view.source.ports.items())) if view.source else ""


def _conditions(view: NodeView) -> str:
    return _cut(GAP.join(f"{name}: {text}" for name, text in view.source.conditions.items())) if view.source else ""


def _cut(words: str) -> str:
    line = words.replace("\n", " ")
    return line if len(line) <= NOTE_LETTERS else f"{line[: NOTE_LETTERS - 1]}…"


def _rectangle(x: float, top: float, width: float, style: str) -> str:
    return f"<rect x='{x:.1f}' y='{top:.1f}' width='{width:.1f}' height='{BOX_PX}' rx='3' {style}/>"


def _trapezium(x: float, top: float, width: float, style: str) -> str:
    bottom = top + BOX_PX
    return (
        f"<polygon points='{x + 8:.1f},{top:.1f} {x + width - 8:.1f},{top:.1f} {x + width:.1f},{bottom:.1f} {x:.1f},{bottom:.1f}' {style}/>"
    )


def _pill(x: float, top: float, width: float, style: str) -> str:
    return f"<rect x='{x:.1f}' y='{top:.1f}' width='{width:.1f}' height='{BOX_PX}' rx='{BOX_PX / 2}' {style}/>"


def _shape(kind: str) -> Callable[[float, float, float, str], str]:
    return {"parallel": _trapezium, "condition": _pill}.get(kind, _rectangle)


def _legend(tree: NodeView, y: float, new: Collection[int]) -> str:
    """Return the signs that the tree has."""
    there = {view.kind for view in tree.walk()}
    parts, x = [], float(MARGIN_PX)
    for kind in (kind for kind in FILLS if kind in there):
        label = f"{SYMBOLS[kind]} {kind}" if kind in SYMBOLS else kind
        width = len(label) * LETTER_PX + 18
        parts.append(_shape(kind)(x, y, width, f"fill='{FILLS[kind]}' stroke='#888'"))
        parts.append(f"<text x='{x + width / 2:.1f}' y='{y + 17:.1f}' text-anchor='middle' fill='#111'>{label}</text>")
        x += width + 10
    if new:
        parts.append(f"<rect x='{x:.1f}' y='{y:.1f}' width='46' height='{BOX_PX}' fill='{NEW_FILL}'/>")
        parts.append(f"<text x='{x + 23:.1f}' y='{y + 17:.1f}' text-anchor='middle' fill='#111'>{NEW_WORDS}</text>")
    return "".join(parts)


def draw(tree: NodeView, title: str, new: Collection[int] = ()) -> str:
    """Return the tree as an SVG document; ``new`` are nodes that get a band, numbered from the top as ``walk`` yields them."""
    canvas = _Canvas(new)
    canvas.node(tree, MARGIN_PX)
    bottom = TITLE_PX + MARGIN_PX + canvas.rows * ROW_PX + 10
    width, height = max(canvas.width, 760, len(title) * TITLE_LETTER_PX) + MARGIN_PX, bottom + BOX_PX + MARGIN_PX
    head = f"<text x='{MARGIN_PX}' y='26' font-size='15' font-weight='bold' fill='#111'>{escape(title)}</text>"
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:.0f} {height:.0f}' width='{width:.0f}' height='{height:.0f}' "
        f"{FONT} font-size='11.5'><rect width='100%' height='100%' fill='white'/>{head}{''.join(canvas.parts)}"
        f"{_legend(tree, bottom, new)}</svg>\n"
    )


def drawn_as_text(tree: NodeView, title: str) -> str:
    """Return the tree for a terminal: a node a line, in the words of the picture."""
    return "\n".join([title, *_lines(tree, "", ""), ""])


def _lines(view: NodeView, branch: str, below: str) -> Iterator[str]:
    yield branch + GAP.join(filter(None, (_label(view), _note(view), _ports(view), _conditions(view))))
    for number, child in enumerate(view.children, start=1):
        last = number == len(view.children)
        yield from _lines(child, below + ("└─ " if last else "├─ "), below + ("   " if last else "│  "))
