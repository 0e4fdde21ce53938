"""The JSON Schemas of `skyloop schema`, by an independent validator: all files of configs/ and labels of its scenes are valid, and misspelt keys,
missing keys and wrong types are not. Argument: the skyloop program."""
import copy
import datetime
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import jsonschema

SKYLOOP = pathlib.Path(sys.argv[1]).resolve()
CONFIGS = pathlib.Path(__file__).resolve().parents[3] / "configs"


def validator(kind):
    schema = json.loads(subprocess.run([SKYLOOP, "schema", kind], check=True, capture_output=True).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def plain(value):
    """TOML's own dates are strings in JSON."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    return value.isoformat().replace("+00:00", "Z") if isinstance(value, datetime.date) else value


def tables(value):
    """All tables in a file."""
    if isinstance(value, dict):
        yield value
    for entry in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from tables(entry)


def kind(path, document):
    if "detector" in document:
        return "camera"
    return {"population.toml": "population", "run.toml": "run", "soak.toml": "run"}.get(path.name, "scene")


files = sorted(CONFIGS.rglob("*.toml"))
assert len(files) > 20, files
refused = 0
for path in files:
    document = plain(tomllib.loads(path.read_text()))
    valid = validator(kind(path, document))
    for error in valid.iter_errors(document):
        raise SystemExit(f"{path}: {error.json_path}: {error.message}")
    # A misspelt key is refused in whatever table it stands; the names of shapes are free.
    for number, table in enumerate(tables(document)):
        if "shapes" in document and table is document["shapes"]:
            continue
        for name in table:
            wrong = copy.deepcopy(document)
            target = list(tables(wrong))[number]
            target[name + "x"] = target.pop(name)
            assert not valid.is_valid(wrong), f"{path}: {name}x is valid"
            refused += 1
    for wrong in ({**document, "seed": "one"}, {**document, "name": 7}, {**document, "objects": 7}):
        assert not valid.is_valid(wrong), path

# Faults of a file: both the schema and the program refuse it, and both accept the file as it was.
FAULTS = {
    "camera": ("fai-nir.toml", [("detector", "width_px", -1), ("detector", "width_px", 2.5), ("detector", "adc_bits", 99), ("detector", "blooming", "x"),
                            ("detector", "pixel_um", "a"), ("timing", "row_us", 10.0), ("timing", "shutter", "rolling"), ("timing", "exposure_s", True),
                            ("optics", "band", "w"), ("optics", "projection", {"k": [0.0]}), ("optics", "projection", {"model": "pinhole", "k": [0.0]}),
                            ("optics", "projection", {"model": "fisheye"}), ("optics", "stray", {"pst": []}), (None, "name", " "), (None, "name", "A\u0007"),
                            (None, "name", "x" * 61)]),
    "run": ({"sequence": {"epoch": "2026-01-01T00:00:00Z", "frames": 1, "period_s": 1.0, "radec": [0.0, 0.0, 0.0]}},
            [("run", "coarsen", ["faster"]), ("run", "coarsen", ["wing_e = much"]), ("run", "coarsen", []), ("run", "link", "127.0.0.1:4810"),
                         ("run", "link", ["tcp://127.0.0.1:4810"]), ("run", "metrics", "localhost"), ("run", "clock", "sun"), ("run", "window_px", 26),
                         ("run", "cpus", [-1]), (None, "fidelity", {"wing_e": "a"}), (None, "fidelity", {"wing_e": 1e9}), (None, "label_snr", -1),
                         ("sky", "catalog", "gaia"), ("observer", "state", [1.0])]),
}


def accepts(kind, text, folder):
    path = pathlib.Path(folder) / "input.toml"
    path.write_text(text)
    words = ["camera", "check", path] if kind == "camera" else ["plan", "--scene", path]
    run = subprocess.run([SKYLOOP, *words], capture_output=True, text=True)
    assert run.returncode in (0, 1), run
    # What `plan` lacks beside a valid file is no fault of the file.
    return run.returncode == 0 or not run.stderr.startswith(f"error: {path}")


def toml(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


with tempfile.TemporaryDirectory() as folder:
    for what, (name, faults) in FAULTS.items():
        document = name if isinstance(name, dict) else plain(tomllib.loads(next(CONFIGS.rglob(name)).read_text()))
        valid = validator(what)
        for table, key, value in [(None, None, None), *faults]:
            wrong = copy.deepcopy(document)
            if key:
                (wrong.setdefault(table, {}) if table else wrong)[key] = value
            text = "\n".join(f"{key} = {toml(value)}" for key, value in wrong.items())
            by_schema, by_program = valid.is_valid(wrong), accepts(what, text, folder)
            assert by_schema == by_program == (key is None), (what, table, key, value, by_schema, by_program)

labels, seen = validator("labels"), set()
with tempfile.TemporaryDirectory() as folder:
    for number, scene in enumerate(["moon-in-field", "near-sun", "south-atlantic-anomaly", "deep-sky", "rcm-2019-06-15"]):
        path = CONFIGS / "scenes" / scene
        path = path if path.is_dir() else path.with_suffix(".toml")
        out = pathlib.Path(folder) / str(number)
        subprocess.run([SKYLOOP, "render", "--scene", path, "--frames", "1", "--out", out], check=True, capture_output=True)
        for line in (out / "labels.jsonl").read_text().splitlines():
            label = json.loads(line)
            for error in labels.iter_errors(label):
                raise SystemExit(f"{scene}: {error.json_path}: {error.message[:300]}")
            seen |= {entry["kind"] for entry in label["objects"]}
            described = set(labels.schema["properties"])
            assert set(label) <= described, f"{scene}: {set(label) - described} are not in the schema"
            for wrong in ({**label, "seed": "one"}, {**label, "objects": [{"kind": "star"}]}):
                assert not labels.is_valid(wrong), scene
            del label["epoch_mid"]
            assert not labels.is_valid(label), scene
assert {"star", "moon", "rso", "radiation"} <= seen, seen
print(f"schemas: {len(files)} files are valid, {refused} misspelt keys are not; labels have {', '.join(sorted(seen))}")
