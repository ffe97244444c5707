"""What the jobs share: a job is done twice, by `ours` and by `theirs`, and answers are compared.

Each function takes the job's input and returns an array. Its lines count without empty ones and
comments.
"""

import ast
import inspect
import statistics
import textwrap
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass
class Outcome:
    job: str
    peer: str
    lines: tuple[int, int]
    seconds: tuple[float, float]
    agreement: str


def lines(function: Callable[..., Any]) -> int:
    """The lines of a function's body, as formatted, without its docstring."""
    body = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0].body
    return sum(len(ast.unparse(statement).splitlines()) for statement in body)


def seconds(function: Callable[..., Any], *values: Any) -> float:
    """The median time of three calls."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        function(*values)
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)


def beside(
    job: str,
    peer: str,
    ours: Callable[..., Any],
    theirs: Callable[..., Any],
    *values: Any,
    tolerance: float = 1e-4,
    exact: np.ndarray | None = None,
) -> Outcome:
    """Does the job both ways. The first calls warm up and give the answers: the share that is
    equal within the tolerance, and the largest difference where both are finite. If the exact
    answer is known, the share of each that is wrong.
    """
    a, b = (np.asarray(way(*values), dtype=np.float64) for way in (ours, theirs))
    same = np.isclose(a, b, rtol=tolerance, atol=tolerance)
    both = np.isfinite(a) & np.isfinite(b)
    largest = np.abs(a - b)[both].max(initial=0.0)
    agreement = f"{same.mean():.4%} equal, by up to {largest:.2g}"
    if exact is not None:
        wrong = [(~np.isclose(x, exact, rtol=tolerance, atol=tolerance)).mean() for x in (a, b)]
        agreement += f"; wrong: {wrong[0]:.4%} : {wrong[1]:.4%}"
    return Outcome(
        job,
        peer,
        (lines(ours), lines(theirs)),
        (seconds(ours, *values), seconds(theirs, *values)),
        agreement,
    )


def torus(sections: int = 128) -> tuple[np.ndarray, np.ndarray]:
    """A ring around z with radii 1 and 0.35: vertices, and triangles that look outwards."""
    u, v = np.meshgrid(*[np.linspace(0, 2 * np.pi, sections, endpoint=False)] * 2, indexing="ij")
    around = 1 + 0.35 * np.cos(v)
    vertices = np.stack([around * np.cos(u), around * np.sin(u), 0.35 * np.sin(v)], -1)
    i, j = np.meshgrid(np.arange(sections), np.arange(sections), indexing="ij")
    k, m = (i + 1) % sections, (j + 1) % sections
    a, b, c, d = (p * sections + q for p, q in ((i, j), (k, j), (k, m), (i, m)))
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)


def terrain(side: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """Hills on a grid with a step of 10: vertices and triangles that look up."""
    x, y = np.meshgrid(np.arange(side) * 10.0, np.arange(side) * 10.0, indexing="ij")
    z = 80 * np.sin(x / 200) * np.cos(y / 260) + 15 * np.sin(x / 37 + y / 53)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    faces = [[corner, corner + side, corner + side + 1], [corner, corner + side + 1, corner + 1]]
    return np.stack([x, y, z], -1).reshape(-1, 3), np.concatenate([np.stack(f, -1) for f in faces])
