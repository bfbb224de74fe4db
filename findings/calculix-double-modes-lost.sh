#!/usr/bin/env bash
# pyvista-frd-reader 0.3.1 (pyvista 0.49.1 reads .frd with it) keeps one of two modes of equal frequency, without a word.
# ccx2paraview 3.2.0 keeps both, but hands fields of an earlier step on to them. The file is from CalculiX 2.20 (Debian 12).
# A round tube, held at one end, sways in two directions at one frequency. CalculiX writes both modes. The reader gathers
# results by their time value, here the frequency, and the later mode overwrites the first.
#   - the file has a static step and two modes; the reader has the times 0.602509 and 1.0, that is one mode. Times are
#     sorted, so this mode even comes before the static step;
#   - sideways compliance of the tip from these modes: 0.97 of L^3/3EI in every direction (theory: 12/1.8751^4 = 0.971).
#     From what the reader returns it is 0.97 in one direction and 0 across it;
#   - the static step asks for S and E, the second for S only. The reader gives modes without E, which is right.
#     ccx2paraview writes the static strains (E, E_Mises, E_Principal) into the files of both modes.
# CalculiX writes frequencies with 10 digits from 1 on, with 6 below. So the last digit decides which pairs are lost.
# Two *BUCKLE steps in one file lose the preload of the first, as both are written at time 0.
# The reader's example of modes says that every mode is a step; its beam has no equal ones. Its list of differences from an
# older reader does not name the case. pygccx, another reader, knows of trouble with equal frequencies (its issue 8).
# The page of ccx2paraview says nothing of fields that a step does not have.
# Why it matters: tubes, rings and round chambers have their modes in pairs. Half of a superposition is missing, and the
# third result is not the third mode. Strains that seem to belong to a mode are those of the pressure before it.
# What to do: compare the number of times with the table of eigenvalues in the .dat file. Take modes through ccx2paraview,
# and ask for the same fields in every step.
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
export CCX=$work/root/usr/bin/ccx CCX_LIBRARIES=$libraries OMP_NUM_THREADS=1
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check pyvista-frd-reader==0.3.1 ccx2paraview==3.2.0 pyvista==0.49.1 vtk==9.7.2 \
    numpy==2.4.6

cat > modes.py <<'END'
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyvista
import pyvista_frd

AROUND, ALONG, INNER, OUTER, LENGTH = 8, 10, 4.0, 5.0, 300.0  # bricks of 20 nodes; mm
SQUARE, SIDES = [(0, 0), (2, 0), (2, 2), (0, 2)], [(1, 0), (2, 1), (1, 2), (0, 1)]  # corners, middle nodes
ids, bricks = {}, []
for k in range(ALONG):
    for j in range(AROUND):
        order = [(SQUARE, 0), (SQUARE, 2), (SIDES, 0), (SIDES, 2), (SQUARE, 1)]
        keys = [(r, (2 * j + a) % (2 * AROUND), 2 * k + z) for layer, z in order for r, a in layer]
        bricks.append([ids.setdefault(key, len(ids) + 1) for key in keys])
deck = "*NODE\n"
for (r, a, z), i in ids.items():
    radius, angle = INNER + (OUTER - INNER) * r / 2, math.pi * a / AROUND
    deck += f"{i}, {radius * math.cos(angle):.10e}, {radius * math.sin(angle):.10e}, {LENGTH * z / 2 / ALONG:.10e}\n"
deck += "*ELEMENT, TYPE=C3D20R, ELSET=ALL\n"
for n, brick in enumerate(bricks, 1):
    deck += f"{n}, " + ", ".join(map(str, brick[:10])) + ",\n" + ", ".join(map(str, brick[10:])) + "\n"
tip = [i for (_, _, z), i in ids.items() if z == 2 * ALONG]
deck += "*MATERIAL, NAME=SILICONE\n*ELASTIC\n1, 0.45\n*DENSITY\n1.1e-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=SILICONE\n"
deck += "*BOUNDARY\n" + "".join(f"{i}, 1, 3\n" for (_, _, z), i in ids.items() if z == 0)
deck += "*STEP\n*STATIC\n*CLOAD\n" + "".join(f"{i}, 3, 1e-3\n" for i in tip) + "*NODE FILE\nU\n*EL FILE\nS, E\n*END STEP\n"
deck += "*STEP\n*FREQUENCY\n2\n*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n"
Path("tube.inp").write_text(deck)
environment = {**os.environ, "LD_LIBRARY_PATH": os.environ["CCX_LIBRARIES"]}
run = subprocess.run([os.environ["CCX"], "tube"], capture_output=True, text=True, env=environment)
assert run.returncode == 0 and "*ERROR" not in run.stdout, run.stdout

table = re.findall(r"^ +([12]) +(\S+) +\S+ +(\S+) +0.0000000E\+00$", Path("tube.dat").read_text(), re.M)[:2]
squares = [float(row[1]) for row in table]  # of the angular frequencies
in_file = Path("tube.frd").read_text().count(" -4  DISP") - 1


def compliance(shapes):
    """Extreme sideways compliances of the tip from modes of mass 1, in L^3/3EI."""
    inertia = math.pi / 4 * (OUTER**4 - INNER**4)
    total = sum((np.outer(u, u) / w2 for u, w2 in shapes), np.zeros((2, 2)))
    return np.linalg.eigvalsh(total)[::-1] / (LENGTH**3 / 3 / inertia)


def tip_of(mesh, name):
    at_tip = mesh.points[:, 2] > LENGTH - 1e-3
    assert at_tip.sum() == len(tip)
    return np.asarray(mesh[name])[at_tip, :2].mean(0)


reader = pyvista_frd.FRDReader("tube.frd")
times = list(reader.time_values)
modes = []
for point, time in enumerate(times):
    reader.set_active_time_point(point)
    if time != 1.0:
        modes.append(reader.read())
by_reader = compliance([(tip_of(mesh, "DISP"), squares[0]) for mesh in modes])
fields = sorted(modes[0].point_data.keys())

subprocess.run([Path(sys.executable).with_name("ccx2paraview"), "tube.frd", "vtu"], check=True, capture_output=True)
static, *converted = [pyvista.read(name) for name in sorted(map(str, Path().glob("tube.*.vtu")))]
by_converter = compliance([(tip_of(mesh, "U"), w2) for mesh, w2 in zip(converted, squares, strict=True)])
stale = all(np.array_equal(mesh["E"], static["E"]) for mesh in converted) and np.abs(static["E"]).max() > 1e-3

print(f"modes: {len(table)} in CalculiX's table, frequencies {table[0][2]}, {table[1][2]}; {in_file} in its result file")
print("pyvista-frd-reader 0.3.1: times", *times)
print("compliance of the tip, largest and smallest, in L^3/3EI (theory, first pair: %.3f)" % (12 / 1.8751041**4))
print("  pyvista-frd-reader  %.3f  %.3f" % tuple(by_reader))
print("  ccx2paraview        %.3f  %.3f" % tuple(by_converter))
print("strains in the modes, that were not asked for: pyvista-frd-reader", "yes" if "TOSTRAIN" in fields else "none", end="")
print("; ccx2paraview", "those of the static step" if stale else "others or none")
seen = len(table) == in_file == 2 and len(times) == 2 and len(modes) == 1 and len(converted) == 2
seen &= np.allclose(by_converter, 0.97, atol=0.03) and abs(by_reader[0] - 0.97) < 0.03 and abs(by_reader[1]) < 1e-6
seen &= stale and "TOSTRAIN" not in fields
print("as described" if seen else "CHANGED: other modes or fields")
sys.exit(not seen)
END
venv/bin/python modes.py
