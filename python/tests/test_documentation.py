"""Every docstring's example runs, and everything public has one."""

from __future__ import annotations

import doctest
import importlib
import inspect

import pytest

import snell

MODULES = ["snell", "snell.distributed", "snell.trimesh", "snell.open3d"]


def documented() -> list[tuple[str, str]]:
    """Names and docstrings of the modules, of what they export, and of the public members of
    classes.
    """
    found = []
    for module in map(importlib.import_module, MODULES):
        found.append((module.__name__, module.__doc__ or ""))
        for name in module.__all__:
            thing = getattr(module, name)
            if not (inspect.isclass(thing) or inspect.isroutine(thing)):
                continue
            found.append((f"{module.__name__}.{name}", thing.__doc__ or ""))
            if inspect.isclass(thing):
                members = {
                    key: value for key, value in vars(thing).items() if not key.startswith("_")
                }
                found += [
                    (f"{module.__name__}.{name}.{key}", value.__doc__ or "")
                    for key, value in members.items()
                ]
    return found


@pytest.mark.parametrize(("name", "text"), documented(), ids=[name for name, _ in documented()])
def test_examples_run(name, text):
    assert len(text.strip()) > 20, f"{name} has no docstring"
    test = doctest.DocTestParser().get_doctest(inspect.cleandoc(text), {}, name, None, None)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    said: list[str] = []
    assert runner.run(test, out=said.append).failed == 0, "".join(said)


def test_what_is_called_has_an_example():
    thing_of = dict(documented())
    for name in vars(snell.Scene):
        if not name.startswith("_") and callable(getattr(snell.Scene, name)):
            assert ">>> " in thing_of[f"snell.Scene.{name}"], name
