"""The Python fuzz targets over their seeds and the same few hundred changes of them every time."""

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parents[1] / "fuzz"
TARGETS = ("urdf", "xacro_file", "scenario", "recording", "mesh_file")
# Each of its inputs starts a process.
SLOW = {"xacro_file": 25}

# In a process of its own: it has folders, warnings and the cache as a fuzzer's run has them.
_RUN = """
import sys
sys.path.insert(0, {folder!r})
from {target} import once
from mutations import mutations
from pathlib import Path
seeds = [path.read_bytes() for path in sorted((Path({folder!r}) / "corpus" / {target!r}).iterdir())]
inputs = [*seeds, *mutations(seeds, {count}, seed=1)]
for row, data in enumerate(inputs):
    try:
        once(data)
    except Exception:
        print("input", row, data[:2000], file=sys.stderr)
        raise
print(len(inputs))
"""


@pytest.mark.parametrize("target", TARGETS)
def test_broken_files_raise_errors_of_ours_only(target: str) -> None:
    count = SLOW.get(target, 400)
    code = _RUN.format(folder=str(FUZZ), target=target, count=count)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    assert int(done.stdout) > count


def test_every_target_has_seeds_and_they_are_small() -> None:
    targets = {folder.name for folder in (FUZZ / "corpus").iterdir()}
    assert targets == {*TARGETS, "tick", "mesh"}
    assert sum(path.stat().st_size for path in (FUZZ / "corpus").rglob("*")) < 200_000
