#!/usr/bin/env bash
# febio-python 0.2.1 answers with the first FEBio model when a second one is read in the same Python process.
# Nodes, elements and materials are cached for the whole process. The key is the number of entries in each section of
# the file, and two models of one template have the same numbers.
#   - A is 1 mm high with E = 0.03 MPa, B 9 mm with E = 5 MPa; read after A, B is 1 mm high with E = 0.03 MPa;
#   - read alone, in a process of its own, B is right;
#   - the XML tree of B in memory is right too, so that B written back to a file is B.
# Nothing warns. (The package does not name tqdm, which it needs.)
# Why it matters: FEBio is the field's finite-element code for soft tissue, and scripts loop over models.
# What to do: one process a model, or empty the caches in between (Feb40.get_nodes.cache.clear() and its like).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check febio-python==0.2.1 tqdm==4.67.1 numpy==2.4.6

cat > read.py <<'END'
import re
import sys
from pathlib import Path

from febio_python.feb import Feb40


def write(name, height, modulus):
    points = [(x, y, z) for z in (0, height) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    nodes = "".join(f'<node id="{i}">{x},{y},{z}</node>' for i, (x, y, z) in enumerate(points, 1))
    with open(name, "w") as file:
        file.write(
            '<?xml version="1.0" encoding="ISO-8859-1"?><febio_spec version="4.0"><Module type="solid"/>'
            '<Material><material id="1" name="tissue" type="neo-Hookean">'
            f"<density>1</density><E>{modulus}</E><v>0.45</v></material></Material>"
            f'<Mesh><Nodes name="all">{nodes}</Nodes>'
            '<Elements type="hex8" name="wall"><elem id="1">1,2,3,4,5,6,7,8</elem></Elements></Mesh>'
            '<MeshDomains><SolidDomain name="wall" mat="tissue"/></MeshDomains></febio_spec>'
        )


def read(name):
    model = Feb40(filepath=name)
    model.write("copy.feb")
    kept = float(re.search(r"<E>(.*?)</E>", Path("copy.feb").read_text())[1])
    return float(model.get_nodes()[0].coordinates[:, 2].max()), model.get_materials()[0].parameters["E"], kept


write("A.feb", 1, 0.03)
write("B.feb", 9, 5.0)
for name in sys.argv[1:]:
    height, modulus, kept = read(name)
    print(f"read {' '.join(sys.argv[1:]):11s}: {name} is {height:g} mm high, E = {modulus:g} MPa; written back E = {kept:g} MPa")
END
{ venv/bin/python read.py B.feb; venv/bin/python read.py A.feb B.feb; venv/bin/python read.py B.feb A.feb; } | tee seen
cat > expected <<'END'
read B.feb      : B.feb is 9 mm high, E = 5 MPa; written back E = 5 MPa
read A.feb B.feb: A.feb is 1 mm high, E = 0.03 MPa; written back E = 0.03 MPa
read A.feb B.feb: B.feb is 1 mm high, E = 0.03 MPa; written back E = 5 MPa
read B.feb A.feb: B.feb is 9 mm high, E = 5 MPa; written back E = 5 MPa
read B.feb A.feb: A.feb is 9 mm high, E = 5 MPa; written back E = 0.03 MPa
END
if diff -q seen expected > /dev/null; then echo "as described"; else echo "CHANGED: expected"; cat expected; exit 1; fi
