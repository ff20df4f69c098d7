"""Draw the README's picture: the first two figures of the page that its own command makes.

python tests/commands/readme_figure.py, after pip install -e .
"""

import re
import tempfile
from pathlib import Path

from validation import cli

HERE = Path(__file__).parents[2]
STYLE = """
text { font: 13px sans-serif; fill: #555; stroke: none; }
.t { fill: #1a1a1a; font-weight: 600; } .x, .l { text-anchor: middle; } .y { text-anchor: end; }
path { fill: none; } .g { stroke: #ddd; stroke-width: .8; } .k { stroke: #767676; }
"""


def main() -> None:
    readme = (HERE / "README.md").read_text(encoding="utf-8")
    toml = re.search(r"```toml\n(title = .*?)```", readme, re.S).group(1)
    command = re.search(r"cablefem (run zip\.toml .*)", readme).group(1).split()
    with tempfile.TemporaryDirectory() as folder:
        scene, out = Path(folder) / "zip.toml", Path(folder) / "out"
        scene.write_text(toml, encoding="utf-8")
        cli.main([str(scene) if word == "zip.toml" else word for word in command] + ["--out", str(out)])
        page = (out / "report.html").read_text(encoding="utf-8")
    figures = re.findall(
        r'<svg role="img"[^>]*?viewBox="0 0 (\d+) ([\d.]+)" class="plot">(.*?)</svg>\s*<(?:ul|figcaption)', page, re.S
    )[:2]
    keys = re.findall(r"<li><svg.*?stroke=\"(.*?)\".*?stroke-dasharray=\"(.*?)\".*?</svg>(.*?)</li>", page)
    parts, top = [], 0.0
    for _, height, content in figures:
        parts.append(f'<g transform="translate(0 {top})">{content}</g>')
        top += float(height) + 8.0
    for i, (color, dash, words) in enumerate(dict.fromkeys(keys)):
        x, y = 40 + 230 * (i % 2), top + 18 * (i // 2)
        line = f'<path d="M{x} {y}h30" stroke="{color}" stroke-width="2" stroke-dasharray="{dash}"/>'
        parts.append(f'{line}<text x="{x + 36}" y="{y + 4}">{words}</text>')
    height = top + 18 * (1 + len(dict.fromkeys(keys)) // 2)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 490 {height:.0f}" width="735">'
    paper = '<rect width="100%" height="100%" fill="#fff"/>'
    text = "\n".join([head, f"<style>{STYLE}</style>", paper, *parts, "</svg>\n"])
    (HERE / "validation/page/assets/readme.svg").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
