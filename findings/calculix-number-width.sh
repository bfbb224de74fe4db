#!/usr/bin/env bash
# CalculiX 2.20 (Debian 12) reads the first 20 characters of a number and drops the rest, the exponent included.
# No message is printed and the exit code is 0.
#   - numpy.savetxt's own format (%.18e) gives exactly 20 characters before the exponent:
#     a fabric strip of 50 x 10 x 0.19 mm is read as 5 x 1 x 1.9 mm.
#   - Python's text of 10*cos(90 deg), 6.123233995736766e-16, has 21 characters:
#     CalculiX reads 6.123233995736766e-1, so the end of a quarter ring jumps by 0.6 mm.
# Other numbers end in "e-" or "e+" after the cut; those, and those alone, give an error.
# Why it matters: most scripts that write decks for soft hearts print node tables in one of these two ways.
# What to do: write at most 13 digits, for example f"{x:.12e}", and compare the volume that CalculiX prints (EVOL).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

unpack() { # Debian packages with what they need, unpacked into $work/root; nothing is installed
    local apt=(-qq -o Dir::State="$work/apt" -o Dir::State::status="$work/apt/status" -o Dir::Cache="$work/cache"
        -o Debug::NoLocking=1 -o APT::Sandbox::User=root)
    mkdir -p apt/lists/partial cache/archives/partial root
    : > apt/status
    apt-get "${apt[@]}" update
    apt-get "${apt[@]}" -y --no-install-recommends --download-only install "$@"
    rm -f cache/archives/libc6_*
    for package in cache/archives/*.deb; do dpkg -x "$package" root; done
    libraries=$(find "$work/root" -name '*.so*' -printf '%h\n' | sort -u | paste -sd:)
}

unpack calculix-ccx=2.20-1
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check numpy==2.4.6

cat > decks.py <<'END'
import math
from pathlib import Path

import numpy as np

REST = """*MATERIAL, NAME=FABRIC
*ELASTIC
267., 0.3
*SOLID SECTION, ELSET=ALL, MATERIAL=FABRIC
*STEP
*STATIC
*BOUNDARY
BOTTOM, 1, 3
*EL PRINT, ELSET=ALL, TOTALS=ONLY
EVOL
*END STEP
"""


def deck(name, node_lines, bricks, bottom):
    text = "*NODE\n" + "\n".join(node_lines) + "\n*ELEMENT, TYPE=C3D8, ELSET=ALL\n"
    text += "".join(f"{i}, " + ", ".join(map(str, brick)) + "\n" for i, brick in enumerate(bricks, 1))
    text += "*NSET, NSET=BOTTOM\n" + ",\n".join(map(str, bottom)) + "\n" + REST
    Path(name + ".inp").write_text(text)


# A strip of fabric, by numpy.savetxt: its default format, and a shorter one
corners = np.array([(x, y, z) for z in (0, 0.19) for x, y in ((0, 0), (50.0, 0), (50.0, 10.0), (0, 10.0))])
for name, number in (("strip_default", "%.18e"), ("strip_short", "%.12e")):
    np.savetxt("nodes.txt", np.c_[np.arange(1, 9), corners], fmt=["%d"] + [number] * 3, delimiter=", ")
    deck(name, Path("nodes.txt").read_text().splitlines(), [range(1, 9)], [1, 2, 3, 4])

# A quarter ring of radii 10 and 11, by Python's own text of a float, and by a shorter one
for name, write in (("ring_default", str), ("ring_short", lambda x: f"{x:.12e}")):
    lines, k = [], 0
    for i in range(5):
        angle = math.pi / 2 * i / 4
        for r, z in ((10.0, 0.0), (11.0, 0.0), (10.0, 1.0), (11.0, 1.0)):
            k += 1
            lines.append(f"{k}, {write(r * math.cos(angle))}, {write(r * math.sin(angle))}, {write(z)}")
    bricks = [[4 * i + j for j in (1, 2, 6, 5, 3, 4, 8, 7)] for i in range(4)]
    deck(name, lines, bricks, [4 * i + j for i in range(5) for j in (1, 2)])
    if name == "ring_default":
        print("as written:", lines[16])
END
venv/bin/python decks.py

for name in strip_default strip_short ring_default ring_short; do
    LD_LIBRARY_PATH=$libraries OMP_NUM_THREADS=1 root/usr/bin/ccx $name > $name.log
    if grep -qi "error" $name.log; then echo "CHANGED: CalculiX reports an error for $name"; exit 1; fi
done

cat > check.py <<'END'
import math
import sys
from pathlib import Path

NAMES = "strip_default", "strip_short", "ring_default", "ring_short"
volume = {name: float(Path(name + ".dat").read_text().split()[-1]) for name in NAMES}
true = {"strip": 50 * 10 * 0.19, "ring": 4 * (11**2 - 10**2) / 2 * math.sin(math.pi / 8)}
for name, value in volume.items():
    print(f"CalculiX 2.20, exit code 0, {name:13s}: volume {value:8.4f} mm3, true {true[name.split('_')[0]]:8.4f} mm3")
seen = (
    math.isclose(volume["strip_default"], 5 * 1 * 1.9, rel_tol=1e-5)
    and math.isclose(volume["strip_short"], true["strip"], rel_tol=1e-5)
    and volume["ring_default"] < 0.97 * true["ring"]
    and math.isclose(volume["ring_short"], true["ring"], rel_tol=1e-5)
)
print("as described" if seen else "CHANGED: numbers of more than 20 characters are read in another way")
sys.exit(not seen)
END
venv/bin/python check.py
