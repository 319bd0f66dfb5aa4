"""A page of the report looked at in Chromium: what can be seen of it at some widths.

``python -m tests.report.in_chromium PAGE`` prints the findings.
"""

import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-extensions")
WAIT_MS = 20_000  # of virtual time: it passes as soon as nothing is left to do

# Runs inside of the page: opens everything that is folded, and looks at every word.
PROBE = """<script>
const errors = [];
addEventListener("error", e => errors.push(String(e.message)), true);
console.error = (...said) => errors.push(said.join(" "));
const parts = text => (text.match(/[\\d.]+/g) || []).map(Number);
const linear = x => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
const light = c => c.map(x => linear(x / 255))
  .reduce((sum, x, i) => sum + x * [0.2126, 0.7152, 0.0722][i], 0);
const contrast = (a, b) => {
  const [x, y] = [light(a), light(b)].sort((p, q) => q - p);
  return (x + 0.05) / (y + 0.05);
};
function paper(element) {
  for (let e = element; e; e = e.parentElement) {
    const c = parts(getComputedStyle(e).backgroundColor);
    if (c.length === 3 || c[3] > 0.5) return c.slice(0, 3);
  }
  return [255, 255, 255];
}
const scrolls = e => {
  for (; e && e !== document.body; e = e.parentElement)
    if (["auto", "scroll", "hidden"].includes(getComputedStyle(e).overflowX)) return true;
  return false;
};
function look() {
  document.querySelectorAll("details").forEach(d => { d.open = true; });
  const small = new Map(), faint = new Map(), wide = new Set();
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  let words = 0;
  while (walk.nextNode()) {
    const text = walk.currentNode.data.trim(), e = walk.currentNode.parentElement;
    if (!text || ["SCRIPT", "STYLE"].includes(e.tagName) || !e.getClientRects().length) continue;
    words += 1;
    const style = getComputedStyle(e), m = e.getScreenCTM ? e.getScreenCTM() : null;
    const size = parseFloat(style.fontSize) * (m ? Math.hypot(m.a, m.b) : 1);
    if (size < 9) small.set(text.slice(0, 40), size);
    const mark = e.classList.contains("mark");
    const ratio = contrast(parts(m ? style.fill : style.color).slice(0, 3), paper(e));
    if (ratio < 4.5 && !mark) faint.set(text.slice(0, 40), ratio);
    const box = e.getBoundingClientRect();
    if (box.right > innerWidth + 1 && !scrolls(e)) wide.add(text.slice(0, 40));
  }
  const ids = new Set([...document.querySelectorAll("[id]")].map(e => e.id));
  const links = [...document.querySelectorAll("a[href^='#']")];
  const lost = links.map(a => a.getAttribute("href").slice(1))
    .filter(name => !ids.has(name));
  const images = [...document.images].filter(i => !(i.complete && i.naturalWidth)).length;
  const uneven = [...document.querySelectorAll(".cells.together")].filter(row => {
    const tops = [...row.children].map(s => s.querySelector(".panel").getBoundingClientRect().top);
    return Math.max(...tops) > Math.min(...tops) + 1;
  }).map(row => row.parentElement.getAttribute("aria-label").slice(0, 60));
  const plots = [...document.querySelectorAll(".panel")].map(p => p.getBoundingClientRect());
  parent.postMessage({
    width: innerWidth, page: document.documentElement.scrollWidth, dark: matchMedia(
    "(prefers-color-scheme: dark)").matches, words, errors, images, lost, uneven, wide: [...wide],
    small: [...small], faint: [...faint], panels: plots.length,
    flat: plots.filter(b => b.width < 60 || b.height < 20).length,
  }, "*");
}
addEventListener("load", look);
</script>"""
FRAMES = """<!DOCTYPE html><body><pre id="found"></pre><script>
const found = [];
addEventListener("message", e => {
  found.push(e.data);
  document.getElementById("found").textContent = JSON.stringify(found);
});
</script>%s</body>"""
FRAME = '<iframe src="page.html" style="width:%dpx;height:900px;color-scheme:%s"></iframe>'


def looked_at(page: str, views: list[tuple[int, str]], folder: Path) -> list[dict[str, Any]]:
    """What is found in each view of a page.

    Parameters
    ----------
    page : str
        The HTML document.
    views : list of tuple of int and str
        Width in pixels, ``light`` or ``dark``.
    folder : Path
        Where the files are written.
    """
    assert BROWSER is not None
    (folder / "page.html").write_text(page.replace("</body>", PROBE + "</body>"), "utf-8")
    frames = "".join(FRAME % view for view in views)
    (folder / "frames.html").write_text(FRAMES % frames, "utf-8")
    command = [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--window-size=2600,1000"]
    command += ["--allow-file-access-from-files", f"--virtual-time-budget={WAIT_MS}", "--dump-dom"]
    done = subprocess.run(
        [*command, (folder / "frames.html").as_uri()], capture_output=True, text=True, timeout=120
    )
    found = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found is not None, done.stderr[-2000:]
    told = json.loads(html.unescape(found.group(1)) or "[]")
    assert len(told) == len(views), done.stderr[-2000:]
    return sorted(told, key=lambda view: (view["dark"], view["width"]))


if __name__ == "__main__":
    text = Path(sys.argv[1]).read_text("utf-8")
    wanted = [(width, scheme) for scheme in ("light", "dark") for width in (390, 768, 1280, 2560)]
    with tempfile.TemporaryDirectory() as place:
        for view in looked_at(text, wanted, Path(place)):
            print(json.dumps(view, ensure_ascii=False, indent=1)[:3000])
