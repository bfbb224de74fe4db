#!/usr/bin/env bash
# CalculiX 2.20 (Debian 12) drops the pressure on membranes (M3D3, M3D4, M3D4R, M3D6, M3D8, M3D8R) in the first step.
# The deck has *DLOAD with label P, as for shells. The very same lines work from the second step on.
# Test: three unit squares are a corner of a cube. Their rim is fixed, and a pressure of 1 acts from inside. The force
# that the free nodes hand on to the rim along each axis is known: 1/4 for 4 nodes, 7/12 for 8, 1/3 and 2/3 for triangles.
#   - P in the first step: force 0, with and without NLGEOM; a second step that keeps this load has force 0 as well;
#   - P given in the second step: the right force;
#   - P2 pulls inwards in the first step and pushes outwards in the second; P1 pushes outwards in both;
#   - shells (S4, S8R), and membranes with *DSLOAD on the surface SNEG, are right in the first step too.
# Exit code and messages are those of a good run. The loads are even counted in its table ("distributed facial loads").
# The manual (Debian's 2.11) calls membranes similar to shells, but for bending; all else said of shells holds for them.
# For shells it wants no number of a face. It says nothing of steps. The public source of later versions, read and not
# run, has the same gap: it knows shells by name, and membranes only after the first step has made bricks of them.
# Why it matters: balloons, pouches and fabric chambers are made of membranes and inflated in the first step. A model that
# does not move looks like a stiff one.
# What to do: *DSLOAD on SNEG (acts along the normal), or pressure from the second step on. Check the force on the supports.
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
export CCX=$work/root/usr/bin/ccx LD_LIBRARY_PATH=$libraries OMP_NUM_THREADS=1

cat > corner.py <<'END'
import os
import re
import subprocess
import sys
from pathlib import Path

# three faces of a unit cube that meet in (1, 1, 1), their normals outwards
SQUARES = [[(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)],
           [(0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)],
           [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]]
RIGHT = {"S4": 1 / 4, "S8R": 7 / 12, "M3D3": 1 / 3, "M3D4": 1 / 4, "M3D4R": 1 / 4, "M3D6": 2 / 3, "M3D8": 7 / 12, "M3D8R": 7 / 12}
LOADS = {"": "", "P": "*DLOAD\nALL, P, 1\n", "P1": "*DLOAD\nALL, P1, 1\n", "P2": "*DLOAD\nALL, P2, 1\n",
         "SNEG": "*DSLOAD\nINSIDE, P, 1\n"}


def forces(kind, *steps, nlgeom=""):
    """Force on the rim (mean of the three axes, outwards positive) at the end of every step; one load a step."""
    size = int(re.search("[3468]R?$", kind)[0].rstrip("R"))
    ids, elements = {}, []
    for square in SQUARES:
        for corners in [square] if size in (4, 8) else [square[:3], [square[0], *square[2:]]]:
            points = [tuple(map(float, point)) for point in corners]
            if size > 4:
                following = points[1:] + points[:1]
                points += [tuple((a + b) / 2 for a, b in zip(p, q, strict=True)) for p, q in zip(points, following, strict=True)]
            elements.append([ids.setdefault(point, len(ids) + 1) for point in points])
    deck = "*NODE\n" + "".join(f"{i}, {x}, {y}, {z}\n" for (x, y, z), i in ids.items())
    deck += f"*ELEMENT, TYPE={kind}, ELSET=ALL\n"
    deck += "".join(f"{n}, " + ", ".join(map(str, element)) + "\n" for n, element in enumerate(elements, 1))
    deck += "*NSET, NSET=RIM\n" + "".join(f"{i},\n" for point, i in ids.items() if min(point) == 0)
    deck += "*SURFACE, NAME=INSIDE\nALL, SNEG\n*MATERIAL, NAME=CLOTH\n*ELASTIC\n1000, 0.3\n"
    deck += f"*{'SHELL' if kind[0] == 'S' else 'MEMBRANE'} SECTION, ELSET=ALL, MATERIAL=CLOTH\n0.05\n"
    deck += f"*BOUNDARY\nRIM, 1, {6 if kind[0] == 'S' else 3}\n"
    for load in steps:
        deck += f"*STEP{nlgeom}\n*STATIC\n1, 1\n{LOADS[load]}*NODE PRINT, NSET=RIM, TOTALS=ONLY\nRF\n*END STEP\n"
    Path("corner.inp").write_text(deck)
    run = subprocess.run([os.environ["CCX"], "corner"], capture_output=True, text=True)
    assert run.returncode == 0 and "*ERROR" not in run.stdout, run.stdout
    assert all("STATIC" in line for line in run.stdout.splitlines() if "*WARNING" in line), run.stdout  # of time steps only
    totals = re.findall(r"total force[^\n]*\n\n([^\n]+)", Path("corner.dat").read_text())
    assert len(totals) == len(steps)
    return [round(-sum(map(float, line.split())) / 3, 9) + 0 for line in totals]


print("force on the rim     right | in the first step:  P       P1       P2     SNEG | in the second:  P       P1       P2")
seen = True
for kind, right in RIGHT.items():
    first = [forces(kind, load)[0] for load in ("P", "P1", "P2", "SNEG")]
    second = [forces(kind, "", load)[1] for load in ("P", "P1", "P2")]
    print(f"  {kind:5s}             {right:7.4f} |             " + " ".join(f"{value:8.4f}" for value in first)
          + " |          " + " ".join(f"{value:8.4f}" for value in second))
    expected = [1, 1, 1, 1] if kind[0] == "S" else [0, 1, -1, 1]
    seen &= all(abs(value - factor * right) < 1e-3 for value, factor in zip(first, expected, strict=True))
    seen &= all(abs(value - right) < 1e-3 for value in second)
kept, again = forces("M3D8R", "P", ""), forces("M3D8R", "P", "P")
large = forces("M3D4", "P", nlgeom=", NLGEOM")
print("M3D8R, P in the first step and kept in the second: %.4f, %.4f; given again: %.4f, %.4f" % (*kept, *again))
print("M3D4, P in the first step with NLGEOM: %.4f" % large[0])
seen &= max(map(abs, kept + large + again[:1])) < 1e-6 and abs(again[1] - 7 / 12) < 1e-3
print("as described" if seen else "CHANGED: other forces")
sys.exit(not seen)
END
python3 corner.py
