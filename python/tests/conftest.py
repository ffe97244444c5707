"""Meshes that many tests use."""

from __future__ import annotations

import signal

import numpy as np
import pytest


def sphere_mesh(rows: int, columns: int, radius: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """A closed sphere around the y axis, outer side outwards: float64 vertices and int32 faces."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1]
    phi = np.arange(columns) * (2 * np.pi / columns)
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones(columns)),
            np.outer(np.sin(theta), np.cos(phi)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = np.concatenate([[[0, 1, 0]], ring, [[0, -1, 0]]]) * radius
    at = lambda i, j: 1 + i * columns + j % columns  # noqa: E731
    faces = []
    for j in range(columns):
        faces.append([0, at(0, j), at(0, j + 1)])
        for i in range(rows - 2):
            faces.append([at(i, j), at(i + 1, j), at(i + 1, j + 1)])
            faces.append([at(i, j), at(i + 1, j + 1), at(i, j + 1)])
        faces.append([len(vertices) - 1, at(rows - 2, j + 1), at(rows - 2, j)])
    return vertices, np.array(faces, dtype=np.int32)


@pytest.fixture(scope="session", autouse=True)
def ctrl_c() -> None:
    """Ctrl-C raises an exception even if a shell runs the tests in the background, where it would
    be ignored.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def sphere() -> tuple[np.ndarray, np.ndarray]:
    return sphere_mesh(24, 48)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)
