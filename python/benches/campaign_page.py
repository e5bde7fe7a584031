"""Puts what `greylag campaign report` says into a page of the documentation, between the marks that the page has for it.

    python python/benches/campaign_page.py --greylag target/release/greylag --campaign params/campaigns/medium.toml \\
        --results results/campaign-medium.jsonl results/campaign-medium.md

The page has `<!-- claims -->` … `<!-- end -->` and `<!-- tables -->` … `<!-- end -->`; what stands outside of these is left alone.
"""

import argparse
import re
import subprocess
import tempfile
from pathlib import Path


def headed(tables):
    """Tables without padding, each under a heading: what `--tables` writes has the title as a line of its own."""
    lines = []
    for line in tables.splitlines():
        if line.startswith("|"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            dashes = all(set(cell) == {"-"} for cell in cells)
            lines.append("|" + "---|" * len(cells) if dashes else "| " + " | ".join(cells) + " |")
        elif line and not line.startswith(("-", "#")):
            lines.append("## " + line)
        else:
            lines.append(line)
    return "\n".join(lines).strip()


def between(page, mark, text):
    """The page with `text` between a mark and its end."""
    pattern = re.compile(rf"(<!-- {mark} -->\n).*?(\n<!-- end -->)", re.DOTALL)
    if not pattern.search(page):
        raise SystemExit(f"the page has no <!-- {mark} --> with an <!-- end -->")
    return pattern.sub(lambda found: found[1] + text + found[2], page, count=1)


def main():
    """Writes the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greylag", required=True)
    parser.add_argument("--campaign", required=True)
    parser.add_argument("--results", required=True)
    parser.add_argument("page", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "tables.md"
        command = [asked.greylag, "campaign", "report", asked.campaign, "--results", asked.results, "--tables", out]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        said = out.read_text()
    claims = [line for line in said.splitlines() if re.search(r": \*\*(holds|contradicted|undecided)\*\*\.", line)]
    tables = "\n".join(line for line in said.splitlines() if line not in claims)
    page = between(asked.page.read_text(), "claims", "\n".join(claims))
    asked.page.write_text(between(page, "tables", headed(tables)))


if __name__ == "__main__":
    main()
