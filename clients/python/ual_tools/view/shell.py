"""Additions to viser's page: a title of its own, lines of the table that can be clicked on, and a panel that is folded
on a phone. Pure.

viser's page is one file of HTML, in which this puts a script. Each part looks for what it needs and does nothing where
that is not there: a page of another version of viser is plain, not broken.
"""

from __future__ import annotations

import gzip

from ual_tools.view.chosen import ALL

CHOICE_LABEL = "UAV"
"""Of the text that has the chosen UAVs."""
STOPS_ATTRIBUTE = "data-ual-stops"
"""In the folder that stops flights and answers: it stays at the top of the panel, whatever is scrolled."""

_SCRIPT = """<script>
(() => {
  const choose = (ns, more) => {
    const label = [...document.querySelectorAll("label")].find(each => each.innerText.trim() === "@LABEL@")
    let near = label
    while (near && !near.querySelector("input")) near = near.parentElement
    if (!near) return
    const input = near.querySelector("input")
    const all = "@ALL@"
    let names = input.value.split(",").map(each => each.trim()).filter(each => each && each !== all)
    if (more) names = names.includes(ns) ? names.filter(each => each !== ns) : [...names, ns]
    else names = names.length === 1 && names[0] === ns ? [] : [ns]
    const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set
    set.call(input, names.length ? names.join(", ") : all)
    input.dispatchEvent(new Event("input", {bubbles: true}))
  }
  document.addEventListener("click", event => {
    const row = event.target.closest && event.target.closest("[data-ual-ns]")
    if (!row) return
    const isMark = event.target.closest("[data-ual-mark]")
    choose(row.dataset.ualNs, event.ctrlKey || event.metaKey || event.shiftKey || isMark)
  })
  const pin = () => {
    const table = document.querySelector("[data-ual-title]")
    let top = document.querySelector("[@STOPS@]")
    while (top && top.parentElement && !top.parentElement.contains(table)) top = top.parentElement
    let scroller = top && top.parentElement
    while (scroller && !/auto|scroll/.test(getComputedStyle(scroller).overflowY)) scroller = scroller.parentElement
    if (!scroller) return
    const transform = `translateY(${scroller.scrollTop}px)`
    Object.assign(top.style, {position: "relative", zIndex: "5", background: "white", transform})
  }
  document.addEventListener("scroll", pin, true)
  setInterval(() => {
    const told = document.querySelector("[data-ual-title]")
    if (told && document.title !== told.dataset.ualTitle) document.title = told.dataset.ualTitle
    pin()
  }, 500)
  if (matchMedia("(max-width: 36em)").matches) {
    const folding = setInterval(() => {
      const handle = document.querySelector('div[style*="cursor: pointer"][style*="height: 3.5em"]')
      if (handle) { handle.click(); clearInterval(folding) }
    }, 100)
  }
})()
</script>"""
_STYLE = """<style>
@media (max-width: 36em) { body .ual-fleet { max-height: 30vh; } }
</style>"""


def with_shell(body: bytes, encoding: str, title: str) -> bytes:
    """Returns the page of viser with what is ours; `encoding` is the header of its content."""
    is_zipped = encoding == "gzip"
    if encoding not in ("", "identity", "gzip"):
        return body
    page = gzip.decompress(body) if is_zipped else body
    script = _SCRIPT.replace("@LABEL@", CHOICE_LABEL).replace("@ALL@", ALL).replace("@STOPS@", STOPS_ATTRIBUTE)
    page = page.replace(b"<title>Viser</title>", f"<title>{title}</title>".encode(), 1)
    page = page.replace(b"</head>", f"{script}{_STYLE}</head>".encode(), 1)
    return gzip.compress(page) if is_zipped else page
