#!/usr/bin/env bash
# CalculiX 2.20 (Debian 12) bends one beam of gel by 67 or by 60 micrometres, depending on the units of its deck.
# The beam has 100 x 10 x 5 micrometres and E = 1 MPa; force and increments are the same in all decks.
#   - in m and N, or in mm and N: 67.1 um after two iterations an increment;
#   - in um and uN: 60.3 um after five iterations an increment, which small increments confirm in all units.
# Exit code and messages are those of a good run. The manual names relative tests of convergence. In fact a residual
# below a fixed small number counts as zero as well, whatever its unit.
# Why it matters: thin membranes, cells and small actuators have nodal forces below a micronewton. CalculiX has no units
# of its own, so a user expects one answer from every consistent system.
# What to do: choose units in which nodal forces are far above 1e-6; repeat a run with smaller increments.
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

cat > beam.py <<'END'
import os
import subprocess
import sys
from pathlib import Path

N = 10  # bricks along the beam
CORNERS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
BRICK = CORNERS + [tuple((p + q) // 2 for p, q in zip(CORNERS[a], CORNERS[b], strict=True)) for a, b in EDGES]


def deflection(name, metre, newton, increment):
    """Deflection of the tip in micrometres, iterations; a metre and a newton in the units of the deck."""
    length, width, height, modulus = 100e-6, 10e-6, 5e-6, 1e6
    force = 3 * modulus * width * height**3 / 12 / length**2  # linear theory would bend the beam by its own length
    ids, nodes, bricks = {}, [], []
    for e in range(N):
        brick = []
        for i, j, k in BRICK:
            key = (2 * e + i, j, k)
            if key not in ids:
                ids[key] = len(ids) + 1
                x, y, z = key[0] * length / (2 * N), j * width / 2, k * height / 2
                nodes.append(f"{ids[key]}, {x * metre:.8e}, {y * metre:.8e}, {z * metre:.8e}")
            brick.append(ids[key])
        bricks.append(f"{e + 1}, " + ", ".join(map(str, brick[:10])) + ",\n" + ", ".join(map(str, brick[10:])))
    root = [i for key, i in ids.items() if key[0] == 0]
    tip = [i for key, i in ids.items() if key[0] == 2 * N]
    deck = "*NODE\n" + "\n".join(nodes) + "\n*ELEMENT, TYPE=C3D20, ELSET=BEAM\n" + "\n".join(bricks)
    deck += "\n*NSET, NSET=ROOT\n" + ",\n".join(map(str, root)) + "\n*NSET, NSET=TIP\n" + ",\n".join(map(str, tip))
    deck += f"\n*MATERIAL, NAME=GEL\n*ELASTIC\n{modulus * newton / metre**2:.8e}, 0.\n*SOLID SECTION, ELSET=BEAM, MATERIAL=GEL\n"
    deck += f"*STEP, NLGEOM, INC=200\n*STATIC\n{increment}, 1., 1e-5, {increment}\n*BOUNDARY\nROOT, 1, 3\n"
    deck += f"*CLOAD\nTIP, 3, {force / len(tip) * newton:.8e}\n*NODE PRINT, NSET=TIP\nU\n*END STEP\n"
    Path(name + ".inp").write_text(deck)
    log = subprocess.run([os.environ["CCX"], name], check=True, capture_output=True, text=True).stdout
    if "*ERROR" in log or "*WARNING" in log:
        sys.exit(f"CHANGED: CalculiX warns in {name}")
    rows = [line.split() for line in Path(name + ".dat").read_text().splitlines() if line.strip()][-len(tip) :]
    return sum(float(row[3]) for row in rows) / len(tip) / metre * 1e6, log.count("\n iteration ")


print("tip of one gel beam by CalculiX 2.20, no warning, exit code 0")
tip = {}
for increment in (0.2, 0.02):
    for units, metre, newton in (("m, N", 1, 1), ("mm, N", 1e3, 1), ("um, uN", 1e6, 1e6)):
        tip[units, increment], iterations = deflection("beam", metre, newton, increment)
        print(f"  increments of {increment:4}: {units:6s} {tip[units, increment]:7.3f} um, {iterations} iterations")
right = 60.334  # um, what all units give with small increments
expected = {("m, N", 0.2): 67.109, ("mm, N", 0.2): 67.109}
seen = all(abs(u / expected.get(key, right) - 1) < 0.002 for key, u in tip.items())
print("as described" if seen else "CHANGED: other deflections")
sys.exit(not seen)
END
python3 beam.py
