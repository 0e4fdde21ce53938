"""Reads vectors/golden.txt: names, fields as text, octets."""
from pathlib import Path

PROTOCOLS = Path(__file__).resolve().parents[2]


def golden():
    """A dictionary of text for every entry; its bytes under `octets`."""
    entries, key = [], None
    for line in (PROTOCOLS / "vectors/golden.txt").read_text(encoding="utf-8").splitlines():
        if not line or line.startswith("#"):
            continue
        if line.startswith("["):
            entries.append({"name": line[1:-1]})
        elif line.startswith(" "):
            entries[-1][key] += line
        else:
            key, _, value = (part.strip() for part in line.partition("="))
            assert key not in entries[-1], line
            entries[-1][key] = value
    for entry in entries:
        entry["octets"] = bytes.fromhex(entry["hex"].replace("|", " "))
    return entries
