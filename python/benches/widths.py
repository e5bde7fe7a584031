"""Writes a copy of a model file in which every coefficient has the same relative standard deviation.

    python python/benches/widths.py SHARE MODEL.toml OUT.toml

A coefficient with the value x gets `sd = SHARE |x|`, which replaces an `sd` in the file. A coefficient that is zero gets no `sd`. The
airframe file must be in the folder of OUT.toml.
"""

import re
import sys

share, source, out = float(sys.argv[1]), sys.argv[2], sys.argv[3]
effect = False
lines = []
for line in open(source):
    section = re.match(r"\[(.*)\]", line)
    if section:
        effect = section.group(1).startswith("effects")
    found = re.match(r"(\w+ = \{ value = )([-+0-9.e]+)(.*)", line)
    if effect and found:
        rest = re.sub(r", sd = [-+0-9.e]+", "", found.group(3))
        width = share * abs(float(found.group(2)))
        sd = f", sd = {width:.6g}" if width > 0 else ""
        line = found.group(1) + found.group(2) + sd + rest + "\n"
    lines.append(line)
open(out, "w").write("".join(lines))
