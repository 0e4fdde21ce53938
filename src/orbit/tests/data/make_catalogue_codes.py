"""Writes catalogue_codes.txt beside this file: PyPI sgp4's error codes over public catalogues.

PyPI package: sgp4 2.27. The folder holds the catalogues, which are not part of this repository;
of them only the places of sets that fail are written, no elements:

    python make_catalogue_codes.py FOLDER
"""

import sys
from importlib.metadata import version
from pathlib import Path

from sgp4.api import Satrec

HERE = Path(__file__).parent
DAYS = [-365, -30, -7, -1, 0, 1, 7, 30, 365]


def sets(path):
    lines = path.read_text().splitlines()
    pairs = zip(lines, lines[1:])
    return [Satrec.twoline2rv(a, b) for a, b in pairs if a.startswith("1 ") and b.startswith("2 ")]


def runs(days, codes):
    """`days code places`, a line for each code but 0; places are sets, counted from 0 in the file's order."""
    for code in sorted(set(codes) - {0}):
        places = " ".join(str(i) for i, one in enumerate(codes) if one == code)
        yield f"{days} {code} {places}\n"


with open(HERE / "catalogue_codes.txt", "w") as out:
    out.write(f"# Error codes of PyPI sgp4 {version('sgp4')}: days from each epoch, code, and the sets that have it, by their places in\n")
    out.write("# the file; all others have none. By catalogue: its name and how many sets it has. See make_catalogue_codes.py.\n")
    for path in sorted(Path(sys.argv[1]).iterdir()):
        all_sets = sets(path)
        out.write(f"= {path.name} {len(all_sets)}\n")
        for days in DAYS:
            out.writelines(runs(days, [one.sgp4_tsince(1440.0 * days)[0] for one in all_sets]))
