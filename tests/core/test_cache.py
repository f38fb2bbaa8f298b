"""A cached result is found again only if nothing it follows from changed: code, data, libraries, inputs."""

from __future__ import annotations

import ast
import gc
import json
import os
import random
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from hicp_lib.core import cache
from hicp_lib.core.cache import LIBRARY_DIR, code, imports_of, key, syntax_tree
from hicp_lib.core.checkout import CHECKOUT
from hicp_lib.core.datafiles import DATA_DIR, REFERENCE_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.formats.annotations import Annotations
from hicp_lib.report.notebooks import read_notebooks
from hicp_lib.report.run import Run
from hicp_lib.report.runs import run_key

# What makes each kind of cached result, and the modules where its code ends.
KINDS = {
    "scenes": (["hicp_lib.simulation.world.scenes"], ()),
    "near": (["hicp_lib.simulation.world.scenes", "hicp_lib.experiments.near"], ()),
    "crops": (["hicp_lib.datasets.subsets"], ()),
    "close": (["hicp_lib.datasets.close"], ()),
    "doses": (["hicp_lib.experiments.doses"], ()),
    "recordings": (["hicp_lib.experiments.recordings.simulate"], ()),
    "avoidance": (["hicp_lib.experiments.avoidance.runs"], ("hicp_lib.detectors.registry",)),
    "detections of mediapipe": (["hicp_lib.detectors.mediapipe.tasks"], ()),
    "detections of openpose": (["hicp_lib.detectors.openpose.networks"], ()),
    "detections of mmpose": (["hicp_lib.detectors.onnx.mmpose"], ()),
    "tables": (["hicp_lib.lifting.table", "hicp_lib.core.cached_tables"], ()),
}


@pytest.fixture
def copy(tmp_path, monkeypatch) -> Path:
    """A copy of the library and its data, of which keys are made."""
    shutil.copytree(LIBRARY_DIR, tmp_path / "hicp_lib", ignore=shutil.ignore_patterns("__pycache__", "data"))
    shutil.copytree(DATA_DIR, tmp_path / "data")
    monkeypatch.setattr(cache, "LIBRARY_DIR", tmp_path / "hicp_lib")
    monkeypatch.setattr(cache, "DATA_DIR", tmp_path / "data")
    return tmp_path


def change_one_byte(path: Path, rng: random.Random) -> bytes:
    """Change a file; what it held before."""
    content = path.read_bytes()
    place = rng.randrange(len(content) + 1)
    new = bytes([content[place] ^ 1]) if place < len(content) else b"\n"
    path.write_bytes(content[:place] + new + content[place + 1 :])
    return content


def module_files(names) -> list[Path]:
    paths = [cache._path(name) for name in names]
    return [path for path in paths if path.stat().st_size]


@pytest.mark.parametrize("kind", KINDS)
def test_one_byte_of_the_code_or_the_data_changes_the_key_and_none_outside_does(kind, request):
    names, without = KINDS[kind]
    original, copy = code(names, without), request.getfixturevalue("copy")
    before, rng = code(names, without), random.Random(kind)
    assert before == original
    inside = module_files(before.modules) + [copy / "data" / name for name in before.data]
    for path in rng.sample(inside, min(12, len(inside))):
        if path.suffix == ".py":  # a comment: the code stays code
            content = path.read_bytes()
            path.write_bytes(content + b"#")
        else:
            content = change_one_byte(path, rng)
        assert code(names, without) != before, path
        path.write_bytes(content)
    outside = [p for p in (copy / "hicp_lib").rglob("*.py") if p not in inside and p.stat().st_size]
    for path in rng.sample(outside, min(12, len(outside))):
        change_one_byte(path, rng)
    assert code(names, without) == before


def test_renderings_do_not_depend_on_what_only_pages_read(copy):
    data = code(["hicp_lib.simulation.world.scenes"]).data
    assert "body.npz" in data and not {"captions.toml", "detector_styles.json", "claims.json"} & set(data)


def test_data_that_are_named_and_not_there_are_told(copy):
    (copy / "data" / "icub.json").unlink()
    with pytest.raises(InputError, match=r"icub\.json: is missing, and a result depends on it"):
        code(["hicp_lib.robot.tables"])


def test_no_result_follows_from_a_reference_run(copy):
    names = ["hicp_lib.study.provenance", "hicp_lib.report.build"]
    before = code(names)
    assert "identities.json" in before.data
    (copy / "data" / "reference" / "full" / "02_x").mkdir(parents=True)
    (copy / "data" / "reference" / "full" / "02_x" / "values.json").write_text("{}")
    assert code(names) == before


def test_another_detector_makes_nobody_look_again():
    of_mediapipe = code(["hicp_lib.detectors.mediapipe.tasks"]).modules
    of_mmpose = code(["hicp_lib.detectors.onnx.mmpose"]).modules
    assert "hicp_lib.detectors.onnx.mmpose" not in of_mediapipe
    assert not any("mediapipe" in name or "openpose" in name for name in of_mmpose)
    names, without = KINDS["avoidance"]
    assert "hicp_lib.detectors.onnx.mmpose" not in code(names, without).modules
    assert "hicp_lib.detectors.onnx.mmpose" in code(names).modules


@pytest.mark.parametrize("kind", KINDS)
def test_all_that_python_loads_is_in_the_closure(kind):
    names, without = KINDS[kind]
    script = f"import sys, {', '.join(names)}\nprint(*(n for n in sys.modules if n.startswith('hicp_lib')))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    known = set(code(names).modules)
    assert set(done.stdout.split()) <= known


def test_whoever_imports_by_name_names_the_whole_module():
    """`import_module` of a text that is put together would hide code from the keys."""
    for path in LIBRARY_DIR.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.JoinedStr):
                parts = [part.value for part in node.values if isinstance(part, ast.Constant)]
                assert not any(part.startswith("hicp_lib.") and "`" not in part for part in parts), path
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, path  # a relative import does not say what it imports
            if isinstance(node, ast.Name):
                assert node.id != "__import__", path


def test_every_library_that_is_called_has_a_version():
    everything = [cache_name(path) for path in LIBRARY_DIR.rglob("*.py")]
    versions = code(everything).libraries
    unknown = {name for name, version in versions.items() if version == "absent"}
    assert unknown == set() and {"numpy", "cv2", "open3d", "pinocchio"} <= set(versions)


def cache_name(path: Path) -> str:
    parts = path.relative_to(LIBRARY_DIR.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


def test_200_random_changes_leave_no_stale_page(copy, monkeypatch):
    """Library, data, lock and notebooks; what a page uses is found here by what its kernel loaded."""
    shutil.copytree(CHECKOUT / "notebooks", copy / "notebooks")
    shutil.copy(CHECKOUT / "environment.lock", copy)
    from hicp_lib.study import provenance

    monkeypatch.setattr(provenance, "LOCK_PATH", copy / "environment.lock")
    loaded = {n.name: loaded_by(n.imports) for n in read_notebooks(copy / "notebooks")}

    def keys():
        return {n.name: run_key(Run(n, n.defaults)) for n in read_notebooks(copy / "notebooks")}

    before, rng = keys(), random.Random(0)
    reference = copy / "data" / REFERENCE_DIR.name
    found = [p for p in copy.rglob("*") if p.is_file() and p.stat().st_size]
    files = [p for p in found if reference not in p.parents]
    code_files = [p for p in files if p.suffix == ".py"]
    for path in [*rng.sample(code_files, 140), *rng.choices([p for p in files if p not in code_files], k=60)]:
        content = path.read_bytes()
        if path.suffix in (".py", ".ipynb", ".toml"):
            path.write_bytes(changed_text(path, content))
        else:
            change_one_byte(path, rng)
        stale = {name for name, new in keys().items() if new != before[name]}
        path.write_bytes(content)
        if path.parent.name == "notebooks":
            must = {path.stem} & set(before)
        elif path.suffix == ".py":
            module = ".".join(path.relative_to(copy).with_suffix("").parts).removesuffix(".__init__")
            must = {name for name, modules in loaded.items() if module in modules}
        else:
            must = set(before)  # every page prints the hashes of data and lock
        assert must <= stale, path
    for path in rng.sample(
        [p for p in found if p not in files], 5
    ):  # what runs are compared with, no page reads
        change_one_byte(path, rng)
        assert keys() == before, path


def changed_text(path: Path, content: bytes) -> bytes:
    if path.suffix != ".ipynb":
        return content + b"#"
    notebook = json.loads(content)
    notebook["cells"][0]["source"] = [*notebook["cells"][0]["source"], " "]
    return json.dumps(notebook).encode()


def loaded_by(names: frozenset[str]) -> set[str]:
    """Modules of the library that a process has loaded after it imported these."""
    script = (
        "import sys, importlib\n"
        "for name in sys.argv[1:]:\n"
        "    try:\n        importlib.import_module(name)\n"
        "    except ModuleNotFoundError:\n        pass\n"  # something within a module
        "print(*(n for n in sys.modules if n.startswith('hicp_lib')))"
    )
    done = subprocess.run([sys.executable, "-c", script, *names], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_inputs_and_entry_points_are_in_the_key(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_bytes(b"1")
    second.write_bytes(b"1")
    keys = [
        key([Path]),
        key([code]),
        key([code], n=1),
        key([code], n=1.0),
        key([code], n=True),
        key([code], n="1"),
        key([code], m=1),
        key([code], n=np.ones(2)),
        key([code], n=np.ones(2, np.float32)),
        key([code], n=first),
        key([code], n=second),
    ]
    assert len(set(keys)) == len(keys)
    assert key([code.__module__]) == key([code])  # a module's name, and what is in it
    with pytest.raises(TypeError, match="the content of object is not known"):
        key([code], n=object())


def test_what_is_imported_for_type_checks_alone_is_no_part():
    source = (
        "from typing import TYPE_CHECKING\n"
        "import a.b as c\n"
        "if TYPE_CHECKING:\n    import d\nelse:\n    import e\n"
        "def f():\n    from g import h\n"
    )
    assert imports_of(source) == {"typing", "typing.TYPE_CHECKING", "a.b", "e", "g", "g.h"}


def test_code_is_parsed_by_several_threads_while_garbage_is_collected():
    """Python's own parser then fails now and then: a callback of the collector lets another thread run."""
    source = Path(imports_of.__code__.co_filename).read_text()
    before = sys.getswitchinterval(), gc.get_threshold()
    callback = lambda *_: sum(range(200))  # noqa: E731
    gc.callbacks.append(callback)
    sys.setswitchinterval(1e-6)
    gc.set_threshold(50)
    try:
        with ThreadPoolExecutor(4) as threads:
            trees = list(threads.map(syntax_tree, [source] * 60))
    finally:
        gc.callbacks.remove(callback)
        sys.setswitchinterval(before[0])
        gc.set_threshold(*before[1])
    assert len(trees) == 60


def test_a_key_is_the_same_in_every_process():
    program = (
        "from hicp_lib.core.cache import code, key\n"
        "print(key([key], made_by=code(['hicp_lib.detectors.mediapipe.tasks'])))"
    )
    keys = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for seed in ("0", "1", "2")
    }
    assert len(keys) == 1


def test_sets_and_annotated_people_have_a_content():
    assert cache.content({3, 1, 2}) == cache.content({2, 3, 1}) != cache.content({1, 2})
    nobody = Annotations.concatenate([], {})
    assert cache.content(nobody) == cache.content(Annotations.concatenate([], {}))
