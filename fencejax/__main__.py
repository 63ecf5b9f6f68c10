"""`python -m fencejax`: the installation, the devices, and commands to run next."""

import importlib.metadata
import importlib.util
import os
import platform

import jax

from ._kept_programs import cache_programs
from ._xla import compiler_flags, tune_compiler
from .printing import Table

_NEXT = (
    'python -c "import fencejax as fj; print(fj.simulate(fj.scenes.oblique_impact()))"',
    "python -m optimize.design --sorter paper --quick --out out",
    "python -m optimize.design --help",
)
_EXTRAS = {"sweep": ("xarray", "zarr", "dask", "distributed"), "notebooks": ("jupyterlab",)}


def _cache() -> str:
    """The folder in which the jobs keep compiled programs, and its size."""
    folder = cache_programs()
    if folder is None:
        return "off"
    sizes = [file.stat().st_size for file in folder.rglob("*") if file.is_file()]
    return f"{folder}, {sum(sizes) / 2**20:.0f} MiB in {len(sizes)} files"


def _extra(names: tuple[str, ...]) -> str:
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    return f"not installed: {', '.join(missing)}" if missing else "installed"


def about() -> Table:
    """Versions, devices, the cache of compiled programs, extras, and commands to run next."""
    tune_compiler()
    devices = [f"{device.device_kind} ({device.platform})" for device in jax.devices()]
    precision = "double" if jax.config.read("jax_enable_x64") else "single"
    rows = [
        ("python", platform.python_version()),
        ("jax", jax.__version__),
        ("precision", f"{precision} unless set otherwise; jobs set double"),
        ("devices", ", ".join(f"{devices.count(d)} x {d}" for d in dict.fromkeys(devices))),
        ("processors", str(os.cpu_count())),
        ("XLA flags", compiler_flags() or "none"),
        ("compiled programs", _cache()),
        *((f"extra {name}", _extra(needs)) for name, needs in _EXTRAS.items()),
        *(("next" if k == 0 else " " * 4, line) for k, line in enumerate(_NEXT)),
    ]  # fmt: skip
    return Table(f"fencejax {importlib.metadata.version('fencejax')}", tuple(rows))


if __name__ == "__main__":
    print(about())
