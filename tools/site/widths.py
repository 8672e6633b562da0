"""Whether a table or a piece of code is wider than the text of its page, in a window of 1280 px: Chromium measures."""

from __future__ import annotations

import functools
import http.server
import json
import re
import shutil
import subprocess
import tempfile
import threading
from html import unescape
from pathlib import Path

_HARNESS = """<!doctype html><meta charset="utf-8"><title>measuring</title>
<iframe style="width:1280px;height:800px;border:0"></iframe><pre id="found"></pre><script>
const frame = document.querySelector("iframe"), found = [], wait = (ms) => new Promise((done) => setTimeout(done, ms));
(async () => {
  for (const page of PAGES) {
    await new Promise((done) => { frame.onload = done; frame.src = page; });
    const article = frame.contentDocument.querySelector("article");
    if (!article) { found.push([page, "no article", 0, 0]); continue; }
    const edge = article.getBoundingClientRect().right;
    for (const each of article.querySelectorAll("table, pre, img")) {
      const right = each.getBoundingClientRect().right;
      const scrolls = each.scrollWidth > each.clientWidth + 1 && each.tagName === "PRE";
      if (right > edge + 4 || scrolls) { // Furo's wrappers have a padding of 3 px
        const words = each.tagName + " " + each.textContent.split(/[^!-~]+/).join(" ").slice(0, 60);
        found.push([page, words, Math.round(right), Math.round(edge)]);
      }
    }
  }
  document.getElementById("found").textContent = JSON.stringify({ count: PAGES.length, found });
  document.title = "measured";
})();
</script>"""


def too_wide(site: Path) -> list[str] | None:
    """Returns what is wider than its text, with its page; None without Chromium."""
    chromium = shutil.which("chromium")
    if chromium is None:
        return None
    pages = sorted(
        f"/{path.relative_to(site).as_posix()}" for path in site.rglob("*.html") if "_static" not in path.parts
    )
    pages = [
        page for page in pages if page not in ("/index.html", "/search.html", "/genindex.html", "/py-modindex.html")
    ]
    handler = functools.partial(_Handler, directory=str(site), harness=_HARNESS.replace("PAGES", json.dumps(pages)))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, tempfile.TemporaryDirectory() as profile:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/measure"
        flags = (
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--window-size=1400,900",
            "--virtual-time-budget=600000",
        )
        command = [chromium, *flags, f"--user-data-dir={profile}", "--dump-dom", address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=600.0, check=False)  # noqa: S603 (found on the path)
        server.shutdown()
    text = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    if text is None or not text[1]:
        raise SystemExit(f"Chromium has not measured the pages: {done.stderr[-500:]}")
    measured = json.loads(unescape(text[1]))
    if measured["count"] != len(pages):
        raise SystemExit(f"Chromium has measured {measured['count']} pages of {len(pages)}")
    return [
        f"{page}: {what} ends at {right} px, the text at {edge} px" for page, what, right, edge in measured["found"]
    ]


class _Handler(http.server.SimpleHTTPRequestHandler):
    """The site, and the page that measures the others."""

    def __init__(self, *args: object, directory: str, harness: str) -> None:
        self._harness = harness
        super().__init__(*args, directory=directory)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Answers with a file or with the page that measures."""
        if self.path != "/measure":
            super().do_GET()
            return
        body = self._harness.encode()
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Writes nothing."""
