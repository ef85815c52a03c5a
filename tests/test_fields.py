"""A setting is declared once, in its struct's table; binding, repr and validation follow it."""

import importlib.util
import math
import shutil
import subprocess
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from proxcgal import _core
from proxcgal.errors import ConfigError

ROOT = Path(__file__).parents[1]
TABLES = _core.field_tables()
# Configs that can be made without arguments.
MADE = sorted(name for name in TABLES if hasattr(_core, name) and name != "GuardConfig")

DUMMY = r"""
#include "bind_fields.hpp"

namespace proxcgal {

enum class Colour : std::uint8_t { kRed, kGreen };
template <>
inline constexpr auto choices<Colour> =
    std::array{Choice{"red", Colour::kRed}, Choice{"green", Colour::kGreen}};

struct DummyConfig {
  double stretch = 0.25;
  Colour colour = Colour::kGreen;
};
template <>
inline constexpr auto fields<DummyConfig> = field_table(
    "DummyConfig", "A config for this test.",
    field(&DummyConfig::stretch, "stretch", "m", above(0).at_most(2), "Length of the stretch."),
    field(&DummyConfig::colour, "colour", "Colour of the body."));

}  // namespace proxcgal

NB_MODULE(dummy_fields, m) {
  nanobind::exception<proxcgal::ConfigError>(m, "ConfigError", PyExc_ValueError);
  proxcgal::binding::bind_fields<proxcgal::DummyConfig>(m);
  proxcgal::binding::bind_field_tables(m);
}
"""


@pytest.fixture(scope="module")
def dummy(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """A module of its own with one config, bound by the same helper as the core's."""
    nanobind = pytest.importorskip("nanobind", reason="needs nanobind's sources")
    compiler = shutil.which("c++") or shutil.which("g++")
    eigen = next((p for p in map(Path, ("/usr/include/eigen3", "/usr/local/include/eigen3"))
                  if p.is_dir()), None)  # fmt: skip
    if compiler is None or eigen is None:
        pytest.skip("needs a C++ compiler and Eigen's headers")
    folder = tmp_path_factory.mktemp("dummy")
    source = folder / "dummy_fields.cpp"
    source.write_text(DUMMY)
    library = Path(nanobind.source_dir())
    places = [ROOT / "cpp" / "include", ROOT / "cpp" / "python", eigen, nanobind.include_dir(),
              library.parent / "ext" / "robin_map" / "include",
              sysconfig.get_paths()["include"]]  # fmt: skip
    # A domain of its own: types that the core has registered are not shared.
    flags = ["-std=c++20", "-O0", "-fPIC", "-fvisibility=hidden", "-w", "-DNB_DOMAIN=dummy",
             *(f"-I{place}" for place in places)]  # fmt: skip

    def compiled(file: Path) -> Path:
        target = folder / f"{file.stem}.o"
        subprocess.run([compiler, *flags, "-c", file, "-o", target], check=True)
        return target

    with ThreadPoolExecutor() as pool:
        objects = list(pool.map(compiled, (source, library / "nb_combined.cpp",
                                           ROOT / "cpp" / "src" / "fields.cpp")))  # fmt: skip
    module = folder / f"dummy_fields{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run([compiler, "-shared", *objects, "-o", module], check=True)
    spec = importlib.util.spec_from_file_location("dummy_fields", module)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def test_a_field_of_a_new_struct_is_in_its_binding(dummy: ModuleType) -> None:
    assert dummy.DummyConfig().stretch == 0.25
    assert dummy.DummyConfig(stretch=1.5, colour="red").colour == "red"
    assert dummy.DummyConfig.__doc__ == "A config for this test."
    assert dummy.DummyConfig.stretch.__doc__ == "[m] Length of the stretch."
    assert dummy.DummyConfig.colour.__doc__ == "Colour of the body. One of 'red', 'green'."
    with pytest.raises(TypeError, match=r"stretch: float = 0\.25, colour: str = 'green'"):
        dummy.DummyConfig(length=1.0)


def test_a_field_of_a_new_struct_is_in_its_repr(dummy: ModuleType) -> None:
    assert repr(dummy.DummyConfig()) == "DummyConfig(stretch=0.25, colour='green')"


def test_a_field_of_a_new_struct_is_validated(dummy: ModuleType) -> None:
    with pytest.raises(dummy.ConfigError) as error:
        dummy.DummyConfig(stretch=3.0)
    assert str(error.value) == "DummyConfig.stretch is 3 m, must be above 0 and at most 2 m"
    with pytest.raises(dummy.ConfigError) as error:
        dummy.DummyConfig(colour="blue")
    assert str(error.value) == "DummyConfig.colour is 'blue', must be one of 'red', 'green'"


def test_a_field_of_a_new_struct_is_in_its_table(dummy: ModuleType) -> None:
    stretch, colour = dummy.field_tables()["DummyConfig"]
    assert (stretch.name, stretch.unit, stretch.type, stretch.default) == (
        "stretch", "m", "float", 0.25)  # fmt: skip
    assert (stretch.least, stretch.least_exclusive) == (0.0, True)
    assert (stretch.most, stretch.most_exclusive) == (2.0, False)
    assert not stretch.may_be_infinite
    assert stretch.sentence == "Length of the stretch."
    assert (colour.type, colour.default, colour.choices) == ("enum", "green", ["red", "green"])


@pytest.mark.parametrize("name", MADE)
def test_a_table_has_the_defaults_of_its_config(name: str) -> None:
    made = getattr(_core, name)()
    for record in TABLES[name]:
        if record.type in ("config", "tasks", "list"):
            continue
        value = getattr(made, record.name)
        default = None if record.optional else record.default
        assert (list(value) if record.type == "vector" else value) == default, record.name


def outside(record: _core.FieldRecord) -> list[Any]:
    """Numbers just outside of a bound, and NaN."""
    whole = record.type == "int"
    found: list[Any] = [] if whole else [math.nan]
    for end, exclusive, beyond in (
        (record.least, record.least_exclusive, -math.inf),
        (record.most, record.most_exclusive, math.inf),
    ):
        if math.isinf(end):
            found += [end] if exclusive and not whole else []
        elif exclusive:
            found.append(int(end) if whole else end)
        else:
            found.append(int(end + math.copysign(1, beyond)) if whole
                         else math.nextafter(end, beyond))  # fmt: skip
    return found


@pytest.mark.parametrize("name", MADE)
def test_each_bound_of_a_table_is_kept(name: str) -> None:
    for record in TABLES[name]:
        if record.type not in ("float", "int"):
            continue
        for value in outside(record):
            with pytest.raises(ConfigError, match=rf"^{name}\.{record.name} is "):
                getattr(_core, name)(**{record.name: value})


def test_configs_inside_others_have_tables_of_their_own() -> None:
    inside = {r.config for table in TABLES.values() for r in table if r.type == "config"}
    assert inside <= TABLES.keys()
    assert {"FilterConfig", "MonitorConfig", "IsoSeparation", "OperatorCapsule"} <= TABLES.keys()
