"""Installs wheels of Snell where there is no Rust, and uses them: the command, the package, Ctrl-C.

    python packaging/check_wheel.py target/wheels/snell-0.1.0-cp310-abi3-linux_x86_64.whl

It prints a table of the wheels, with what was run, and fails if one is too large or does not work.
Wheels for other machines are listed and not run. That for Linux on AArch64 is run in an emulator if
the variable `PYTHON_AARCH64` has the command of a Python for it, such as
`qemu-aarch64 -L ROOT ROOT/usr/bin/python3.11`. NumPy is installed from the index of packages, or
from a folder that `PIP_FIND_LINKS` names.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

LARGEST = 15_000_000
"""The size in bytes that a wheel may have. (The aim is 12 MB. Of 14, ten are machine code: kernels
for three kinds of processors, readers, serialisation; two and a half are tables, one unwinding.)"""

USE = """
import sys
import snell
image = snell.render("cornell-box", spp=1, size=(32, 24))
assert image.shape[:2] == (24, 32), image
assert snell.Scene().cast_rays([0, 0, 0, 0, 0, 1]).t_hit == float("inf")
"""


def environment(folder: Path, wheel: Path) -> dict[str, str]:
    """A fresh environment that has the wheel and what it needs, and no Rust on its path."""
    venv.create(folder, with_pip=True)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    system = os.environ["PATH"] if os.name == "nt" else "/usr/bin:/bin"
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    variables = {**kept, "PATH": os.pathsep.join([str(programs), system])}
    pip = [str(programs / "python"), "-m", "pip", "install", "--quiet"]
    subprocess.run([*pip, "--disable-pip-version-check", str(wheel)], env=variables, check=True)
    return variables


def timed(command: list[str], variables: dict[str, str], folder: Path) -> tuple[float, str]:
    """Seconds and standard output of a command, which must succeed."""
    program = shutil.which(command[0], path=variables["PATH"]) or command[0]
    start = time.perf_counter()
    done = subprocess.run(
        [program, *command[1:]], env=variables, cwd=folder, capture_output=True, text=True
    )
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return time.perf_counter() - start, done.stdout


def interrupt(variables: dict[str, str], folder: Path) -> None:
    """Ctrl-C ends a render with exit code 130, and keeps what it has."""
    program = shutil.which("snell", path=variables["PATH"])
    assert program is not None
    picture = folder / "interrupted.png"
    log = folder / "interrupted.txt"
    with log.open("w") as messages:
        running = subprocess.Popen(
            [program, "render", "--time", "120s", "-o", str(picture)],
            env=variables,
            cwd=folder,
            stderr=messages,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
        time.sleep(4)
        running.send_signal(signal.SIGINT)
        code = running.wait(60)
    if code != 130 or not picture.exists() or "Traceback" in log.read_text():
        raise SystemExit(f"Ctrl-C: exit code {code}, not 130 with a picture:\n{log.read_text()}")


def use(wheel: Path) -> str:
    """Uses a wheel, and says what was run."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        start = time.perf_counter()
        variables = environment(folder / "venv", wheel)
        installed = time.perf_counter() - start
        timed(["snell", "--version"], variables, folder)
        version, said = timed(["snell", "--version"], variables, folder)
        assert said.split()[0] == "snell", said
        render, _ = timed(["snell", "render", "cornell-box", "--spp", "4"], variables, folder)
        digest = hashlib.sha256((folder / "cornell-box.png").read_bytes()).hexdigest()
        package, _ = timed(["python", "-c", USE], variables, folder)
        parts = [
            f"installed in {installed:.1f} s",
            f"version in {version:.2f} s",
            f"cornell-box, 4 samples, in {render:.1f} s (PNG {digest[:8]})",
            f"package in {package:.1f} s",
        ]
        if os.name == "posix":
            interrupt(variables, folder)
            parts.append("Ctrl-C")
        return "; ".join(parts)


def use_emulated(wheel: Path, python: list[str]) -> str:
    """Uses a wheel for AArch64 by a Python in an emulator, and says what was run."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        packages = folder / "packages"
        ask = "import sys; print('{}.{}'.format(*sys.version_info))"
        _, version = timed([*python, "-c", ask], dict(os.environ), folder)
        choice = ["--only-binary=:all:", "--python-version", version.strip()]
        for system in ["manylinux_2_17", "manylinux2014", "manylinux_2_28"]:
            choice += ["--platform", f"{system}_aarch64"]
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, *choice, "--target", str(packages), str(wheel)], check=True)
        variables = {**os.environ, "PYTHONPATH": str(packages)}
        snell = [*python, "-m", "snell"]
        timed([*snell, "--version"], variables, folder)
        render, _ = timed([*snell, "render", "cornell-box", "--spp", "4"], variables, folder)
        digest = hashlib.sha256((folder / "cornell-box.png").read_bytes()).hexdigest()
        timed([*python, "-c", USE], variables, folder)
        picture = f"cornell-box, 4 samples, in {render:.1f} s (PNG {digest[:8]})"
        return f"in an emulator: version; {picture}; package"


def runs_here(wheel: Path) -> bool:
    """True for wheels of this system and processor."""
    system = {"linux": "linux", "darwin": "macosx", "win32": "win"}.get(sys.platform, sys.platform)
    tag = wheel.stem.split("-")[-1]
    return system in tag and tag.endswith(platform.machine().lower())


def report(wheel: Path) -> str:
    """What was run of a wheel."""
    if runs_here(wheel):
        return use(wheel)
    if (python := os.environ.get("PYTHON_AARCH64")) and wheel.stem.endswith("17_aarch64"):
        return use_emulated(wheel, shlex.split(python))
    return "not run: it is for another machine"


def main(names: list[str]) -> int:
    """Prints the table; 1 if a wheel is too large."""
    wheels = [Path(name).resolve() for name in names]
    if not wheels:
        print("name the wheels: python packaging/check_wheel.py FILE...", file=sys.stderr)
        return 2
    print("| wheel | MB | what was run |\n|---|---|---|")
    for wheel in wheels:
        size = wheel.stat().st_size / 1e6
        print(f"| {wheel.name} | {size:.1f} | {report(wheel)} |", flush=True)
    large = [wheel.name for wheel in wheels if wheel.stat().st_size > LARGEST]
    if large:
        print(f"error: larger than {LARGEST / 1e6:.0f} MB: {', '.join(large)}", file=sys.stderr)
    return 1 if large else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
