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
    return value.isoformat() if isinstance(value, datetime.date) else value


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
