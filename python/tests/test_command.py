"""The command ``snell`` in the package, and names that are imported on first use."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import snell
from snell._names import NAMES

COMMAND = [sys.executable, "-m", "snell"]


def run(*arguments: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, **options)


def test_the_command_says_its_version():
    done = run("--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"snell {snell.__version__}\n", "")


def test_wrong_usage_is_named_as_by_the_program():
    done = run("render", "--size", "nothing")
    assert done.returncode == 2 and done.stdout == ""
    assert "For more information, try '--help'" in done.stderr
    assert "Usage: snell render" in run("render", "--help").stdout
    done = run("info", "absent.obj")
    assert done.returncode == 1 and done.stderr.startswith("error: absent.obj: ")


def test_a_picture_is_that_of_the_package(tmp_path):
    path = tmp_path / "box.pfm"
    done = run("render", "cornell-box", "--spp", "1", "--size", "16x12", "-o", str(path))
    assert done.returncode == 0, done.stderr
    snell.render("cornell-box", spp=1, size=(16, 12)).save(tmp_path / "same.pfm")
    assert path.read_bytes() == (tmp_path / "same.pfm").read_bytes()


def test_output_without_a_last_line_break_is_not_lost(tmp_path):
    done = subprocess.run([*COMMAND, "render", "--spp", "1", "--size", "8x8", "-o", "-"],
                          capture_output=True)  # fmt: skip
    assert done.returncode == 0 and done.stdout.endswith(b"IEND\xaeB`\x82")


def test_a_closed_pipe_is_no_error():
    program = subprocess.Popen([*COMMAND, "man"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert program.stdout and program.stderr
    program.stdout.close()
    assert (program.stderr.read(), program.wait()) == (b"", 0)
    program.stderr.close()


@pytest.mark.skipif(os.name == "nt", reason="signals are those of Unix")
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_commands_save_what_they_have(tmp_path, kind):
    picture = tmp_path / "box.png"
    command = [*COMMAND, "render", "--time", "60s", "-o", str(picture)]
    reset = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # noqa: E731
    program = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=reset)
    time.sleep(3)
    program.send_signal(kind)
    assert program.stderr
    said = program.stderr.read()
    assert program.wait() == 130 and picture.exists(), said
    assert "Traceback" not in said
    program.stderr.close()


def test_the_command_starts_without_numpy():
    code = "import sys, snell.__main__, snell._snell; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_the_table_of_names_is_what_type_checkers_read():
    tree = ast.parse(Path(snell.__file__).read_text())
    read = {
        alias.name: node.module.removeprefix("snell.")
        for branch in ast.walk(tree)
        if isinstance(branch, ast.If)
        for node in branch.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    assert read == NAMES and sorted(NAMES) == sorted(snell.__all__)
    assert set(snell.__all__) <= set(dir(snell))
    with pytest.raises(AttributeError, match="module 'snell' has no attribute 'cube'"):
        snell.cube  # noqa: B018
