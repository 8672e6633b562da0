"""A small drawing in SVG: boxes, arrows and words on a white ground, which light and dark pages both show."""

from __future__ import annotations

from html import escape

_STYLE = (
    "text{font:14px sans-serif;fill:#1d2733}.s{font-size:12px;fill:#52606d}.t{font-weight:bold}"
    ".b{fill:#eef3f8;stroke:#4a6785;stroke-width:1.5}.g{fill:#e6f4e8;stroke:#3d7a48;stroke-width:1.5}"
    ".r{fill:#fdeaea;stroke:#a84444;stroke-width:1.5}.y{fill:#fff6dc;stroke:#98761b;stroke-width:1.5}"
    ".n{fill:none;stroke:#4a6785;stroke-width:1.5}.d{stroke-dasharray:6 4}"
    ".a{fill:none;stroke:#37475a;stroke-width:1.5;marker-end:url(#e)}"
)
_ARROW = (
    '<marker id="e" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto-start-reverse">'
    '<path d="M0 0L8 4L0 8z" fill="#37475a"/></marker>'
)
_LINE_PX = 17
Point = tuple[float, float]


class Drawing:
    """A picture that grows by its methods, and is text at the end."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self._size = width, height
        self._title = title
        self._parts: list[str] = []

    def box(self, x: float, y: float, width: float, height: float, text: str, kind: str = "b") -> None:
        """Draws a box with centred lines; the first one is bold."""
        self._parts.append(f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6"/>')
        lines = text.split("\n")
        first = y + height / 2 - (len(lines) - 1) * _LINE_PX / 2 + 5
        for number, line in enumerate(lines):
            self.words(x + width / 2, first + number * _LINE_PX, line, "t" if number == 0 else "s", "middle")

    def words(self, x: float, y: float, text: str, kind: str = "s", anchor: str = "start") -> None:
        """Writes a line."""
        self._parts.append(f'<text class="{kind}" x="{x:g}" y="{y:g}" text-anchor="{anchor}">{escape(text)}</text>')

    def arrow(
        self, *points: Point, text: str = "", at: Point | None = None, kind: str = "a", anchor: str = "middle"
    ) -> None:
        """Draws a line with an arrow head through the points, and its words at a place (else at the middle)."""
        path = " L".join(f"{x:g} {y:g}" for x, y in points)
        self._parts.append(f'<path class="{kind}" d="M{path}"/>')
        if text:
            (x0, y0), (x1, y1) = points[0], points[-1]
            x, y = at or ((x0 + x1) / 2, (y0 + y1) / 2 - 6)
            for number, line in enumerate(text.split("\n")):
                self.words(x, y + number * 14, line, "s", anchor)

    def shape(self, markup: str) -> None:
        """Adds markup as it is."""
        self._parts.append(markup)

    def __str__(self) -> str:
        width, height = self._size
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
            f'role="img"><title>{escape(self._title)}</title><style>{_STYLE}</style><defs>{_ARROW}</defs>'
            f'<rect width="{width}" height="{height}" fill="#fff"/>\n' + "\n".join(self._parts) + "\n</svg>\n"
        )
