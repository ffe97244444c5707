"""Every parameter has in Python the name, default and range that its declaration says."""

from __future__ import annotations

import re

import pytest

import snell

FAMILIES = {
    "material": (snell.Material, snell.MATERIALS),
    "pattern": (snell.Pattern, snell.PATTERNS),
    "medium": (snell.Medium, snell.MEDIA),
    "light": (snell.Light, snell.LIGHTS),
}
# Values of parameters that are not a single number.
GIVEN = {
    "spectrum": "metal:Au",
    "conductor": snell.Material("conductor", spectrum="metal:Au"),
    "falloff": {"falloff": "smooth", "inner": 0.1, "outer": 0.2},
    "axes": [(1, 0, 0), (0, 1, 0)],
    "lengths": (1, 2),
    "density": [[[1.0]]],
}
KINDS = [
    (family, kind)
    for family, (_, kinds) in FAMILIES.items()
    for kind in kinds
    # Their tables come from files.
    if kind not in ("profile", "projector")
]


def required(family: str, kind: str) -> dict:
    """Parameters without a default, and values for them."""
    found = {}
    for name, about in snell.describe(family, kind).items():
        if "default" not in about and about["kind"] not in ("matrix", "grid, or none"):
            plain = {"vector": (0, 0, 1), "number": 0.5}.get(about["kind"])
            found[name] = GIVEN.get(name, 0.5) if plain is None else plain
    return found


def outside(words: str) -> float | None:
    """A number outside of a range that is given in words."""
    number = r"-?[0-9.]+(?:e[0-9]+)?"
    if words in ("more than 0", "0 or more"):
        return 0 if words == "more than 0" else -1
    if between := re.fullmatch(rf"more than ({number}) and less than ({number})", words):
        return float(between[2])
    if within := re.match(rf"({number}) to ({number})", words):
        return float(within[1]) - 1 if float(within[2]) > 1e20 else float(within[2]) * 2
    return None


@pytest.mark.parametrize(("family", "kind"), KINDS)
def test_names_and_defaults_are_those_of_the_declaration(family, kind):
    make, kinds = FAMILIES[family]
    about = snell.describe(family, kind)
    assert set(kinds[kind]) - {"bounds"} == set(about)
    thing = make(kind, **required(family, kind))
    for name, says in about.items():
        assert says["doc"], name
        assert name in thing.parameters
        if "default" in says and says["kind"] != "matrix":
            assert thing.parameters[name] == says["default"], name


@pytest.mark.parametrize(("family", "kind"), KINDS)
def test_ranges_are_enforced(family, kind):
    make, _ = FAMILIES[family]
    for name, says in snell.describe(family, kind).items():
        wrong = outside(says["range"])
        if wrong is None:
            continue
        values = {"2 numbers": [wrong, 1], "3 numbers": [wrong] * 3}
        value = values.get(says["kind"], wrong)
        with pytest.raises(ValueError, match=f"{name}.* is not possible, expected"):
            make(kind, **{**required(family, kind), name: value})


def test_names_inside_of_a_parameter_are_known_or_an_error():
    color = {"factor": (1, 1, 1), "nonsense": 1}
    message = r"plastic.*: roughness: there is no parameter \"nonsense\" \(known: factor, texture"
    with pytest.raises(TypeError, match=message):
        snell.Material("plastic", diffuse=0.5, roughness={"nonsense": 1})
    with pytest.raises(TypeError, match="diffuse: there is no parameter"):
        snell.Material("plastic", diffuse=color)
    with pytest.raises(TypeError, match="emission: there is no parameter"):
        snell.Material("diffuse", reflectance=0.5, emission=color)


def test_what_there_is_not_is_said_so():
    with pytest.raises(ValueError, match=r"no family \"materials\"; did you mean \"material\""):
        snell.describe("materials", "diffuse")
    with pytest.raises(ValueError, match=r"no light \"sopt\"; did you mean \"spot\""):
        snell.describe("light", "sopt")
