#!/usr/bin/env bash
# CalculiX 2.20 (Debian 12) gives three critical pressures for one ring, one per procedure.
# Theory, in EI/R^3: 3 for a pressure that turns with the surface, 4 for one that keeps its direction.
#   - *STATIC, NLGEOM up to close below buckling: 3.01, right (from the growth of an imperfection, Southwell's plot).
#   - *BUCKLE: 3.84, as if the pressure kept its direction (4 less the effect of the thickness).
#     The manual says that it takes the stress stiffness only.
#   - *FREQUENCY, PERTURBATION, where the lowest frequency reaches 0: 2.46, as if the load stiffness counted twice:
#     1/2.46 = 1/3.84 + 2 (1/3.01 - 1/3.84).
# The manual finds the buckling load of its first example by both short ways. For a force of fixed direction they agree.
# Why it matters: both are the quick look at when a pouch or a valve ring of a soft heart snaps. They differ by 56 %.
# What to do: take buckling pressures from nonlinear runs with a small imperfection, mode shapes alone from the others.
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

cat > ring.py <<'END'
import math
import os
import re
import subprocess
import sys
from pathlib import Path

R, T, WIDTH, E, N = 100.0, 4.0, 4.0, 1000.0, 16  # mm, MPa; a quarter in N bricks of 20 nodes
UNIT = E * T**3 / 12 / R**3  # pressure EI/R^3 per unit of width
CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
BRICK = CORNERS + [tuple((p + q) // 2 for p, q in zip(CORNERS[a], CORNERS[b], strict=True)) for a, b in EDGES]


def run(name, steps, imperfection=0.0):
    """The printed results of the quarter ring under the steps; its radius varies by imperfection * cos(2 angle)."""
    ids, nodes, bricks = {}, [], []
    for e in range(N):
        brick = []
        for radial, around, across in BRICK:
            key = (2 * e + around, radial, across)
            if key not in ids:
                ids[key] = len(ids) + 1
                angle = math.pi / 4 * key[0] / N
                r = R + T * (radial - 1) / 2 + imperfection * math.cos(2 * angle)
                nodes.append(f"{ids[key]}, {r * math.cos(angle):.10f}, {r * math.sin(angle):.10f}, {WIDTH * across / 2:.10f}")
            brick.append(ids[key])
        bricks.append(f"{e + 1}, " + ", ".join(map(str, brick[:10])) + ",\n" + ", ".join(map(str, brick[10:])))
    x0 = ",\n".join(str(i) for key, i in ids.items() if key[0] == 2 * N)
    y0 = ",\n".join(str(i) for key, i in ids.items() if key[0] == 0)
    deck = "*NODE, NSET=ALL\n" + "\n".join(nodes) + "\n*ELEMENT, TYPE=C3D20R, ELSET=RING\n" + "\n".join(bricks)
    deck += f"\n*NSET, NSET=X0\n{x0}\n*NSET, NSET=Y0\n{y0}\n*NSET, NSET=POINT\n{ids[0, 1, 0]}\n"
    deck += "*BOUNDARY\nALL, 3, 3\nX0, 1, 1\nY0, 2, 2\n*MATERIAL, NAME=M\n*ELASTIC\n" + f"{E}, 0.\n*DENSITY\n1e-9\n"
    deck += "*SOLID SECTION, ELSET=RING, MATERIAL=M\n" + steps
    Path(name + ".inp").write_text(deck)
    subprocess.run([os.environ["CCX"], name], check=True, stdout=subprocess.DEVNULL)
    return Path(name + ".dat").read_text()


def load(p):
    return f"*DLOAD\nRING, P4, {p * UNIT:.8e}\n"  # face 4 of the bricks is the outside


def lowest(text):
    """Second column of the first row that starts with mode 1."""
    return float(re.search(r"^ +1 +(\S+)", text, re.M)[1])


buckle = lowest(run("buckle", "*STEP\n*BUCKLE\n1\n" + load(1.0) + "*END STEP\n"))

modes = "*STEP, PERTURBATION\n*FREQUENCY\n1\n*END STEP\n"
free = lowest(run("free", "*STEP\n*FREQUENCY\n1\n*END STEP\n"))  # eigenvalue, the square of the angular frequency
at_2 = lowest(run("loaded", "*STEP, NLGEOM\n*STATIC\n" + load(2.0) + "*END STEP\n" + modes))
frequency = 2.0 / (1 - at_2 / free)

growth = []
for p in (1.5, 2.0, 2.4):
    tight = "*CONTROLS, PARAMETERS=FIELD\n1e-5, 1e-5\n"
    step = "*STEP, NLGEOM, INC=200\n*STATIC\n0.1, 1., , 0.1\n" + tight + load(p) + "*NODE PRINT, NSET=POINT\nU\n*END STEP\n"
    u = float(run("grown", step, 0.5).splitlines()[-1].split()[1])
    growth.append((p, u + p * UNIT * (R + T / 2) * R / (E * T)))  # less the even shrinking of the ring
(p1, w1), _, (p2, w2) = growth
nonlinear = (w2 - w1) / (w2 / p2 - w1 / p1)

print("critical pressure of one ring by CalculiX 2.20, in EI/R^3")
print(f"  *STATIC, NLGEOM            {nonlinear:.3f}   (theory: 3 for a pressure that follows the surface)")
print(f"  *BUCKLE                    {buckle:.3f}   (theory: 4 for a pressure that keeps its direction)")
print(f"  *FREQUENCY, PERTURBATION   {frequency:.3f}")
twice = 1 / (1 / buckle + 2 * (1 / nonlinear - 1 / buckle))
print(f"  load stiffness twice       {twice:.3f}   (from the first two)")
seen = abs(nonlinear - 3.005) < 0.02 and abs(buckle - 3.838) < 0.02 and abs(frequency - 2.456) < 0.02
print("as described" if seen else "CHANGED: other critical pressures")
sys.exit(not seen)
END
python3 ring.py
