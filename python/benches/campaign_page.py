"""Inserts the output of `greylag campaign report` into a page of the documentation.

    python python/benches/campaign_page.py --greylag target/release/greylag --campaign params/campaigns/medium.toml \\
        --results results/campaign-medium.jsonl results/campaign-medium.md

The text between `<!-- claims -->` and `<!-- end -->`, and between `<!-- tables -->` and `<!-- end -->`, is replaced. The rest of the
page is not changed.
"""

import argparse
import re
import subprocess
import tempfile
from pathlib import Path


def headed(tables):
    """The tables of `--tables` without padding. The line with the title of a table becomes a heading."""
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
    """The page with `text` between the comment `mark` and the next end mark."""
    pattern = re.compile(rf"(<!-- {mark} -->\n).*?(\n<!-- end -->)", re.DOTALL)
    if not pattern.search(page):
        raise SystemExit(f"the page has no <!-- {mark} --> with an <!-- end -->")
    return pattern.sub(lambda found: found[1] + text + found[2], page, count=1)


def main():
    """Runs the report and writes the page."""
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
