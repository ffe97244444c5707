"""Contact sheets of materials, to be looked at: every parameter of OpenPBR swept, every metal by
name.

    python bench/contact_sheets.py OUTPUT-FOLDER [--snell target/release/snell] [--spp 64]
        [--only WORD]

Needs Pillow. The files of a folder are shown by `suites.py`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

from sheet import Sheet

TILE = (400, 225)

RED, GOLD = [0.7, 0.08, 0.05], [0.9, 0.65, 0.3]
WHITE, GREY, BLACK = [1, 1, 1], [0.5, 0.5, 0.5], [0, 0, 0]
PLASTIC = {"base_color": RED}
METAL = {"base_metalness": 1, "base_color": GOLD}
BRUSHED = {**METAL, "specular_roughness": 0.45}
GLASS = {"transmission_weight": 1, "specular_roughness": 0}
MILK = {
    **GLASS,
    "transmission_depth": 1,
    "transmission_color": [0.9, 0.9, 0.9],
    "transmission_scatter": [2, 2, 2],
}
SKIN = {"subsurface_weight": 1, "subsurface_color": [0.9, 0.5, 0.35], "subsurface_radius": 0.2}
COATED = {"coat_weight": 1, "base_color": RED, "specular_roughness": 0.5}
FUZZY = {"fuzz_weight": 1, "base_color": [0.05, 0.05, 0.1], "specular_weight": 0}
FILMED = {"thin_film_weight": 1, "base_color": [0.1, 0.1, 0.1], "specular_roughness": 0.1}
SHEET = {**GLASS, "geometry_thin_walled": True}

# What is swept, with what else, from value to value (over the three large balls).
SWEEPS: list[tuple[str, dict, list]] = [
    ("base_weight", PLASTIC, [0, 0.5, 1]),
    ("base_color", {}, [WHITE, RED, [0.05, 0.3, 0.6]]),
    ("base_diffuse_roughness", {"base_color": RED, "specular_weight": 0}, [0, 0.5, 1]),
    ("base_metalness", {"base_color": GOLD}, [0, 0.5, 1]),
    ("specular_weight", PLASTIC, [0, 0.5, 1]),
    ("specular_color", METAL, [WHITE, [0.5, 1, 0.5], BLACK]),
    ("specular_color", PLASTIC, [WHITE, [0.3, 1, 0.3], BLACK]),
    ("specular_roughness", METAL, [0, 0.5, 1]),
    ("specular_roughness", PLASTIC, [0, 0.5, 1]),
    ("specular_roughness", GLASS, [0, 0.25, 0.6]),
    ("specular_roughness_anisotropy", BRUSHED, [0, 0.5, 1]),
    ("specular_ior", {"base_color": RED, "specular_roughness": 0.1}, [1.1, 1.5, 2.5]),
    ("specular_ior", GLASS, [1.1, 1.5, 2.5]),
    ("transmission_weight", {"base_color": RED, "specular_roughness": 0}, [0, 0.5, 1]),
    ("transmission_color", GLASS, [WHITE, [0.3, 0.8, 0.5], [0.8, 0.2, 0.1]]),
    ("transmission_depth", {**GLASS, "transmission_color": [0.2, 0.7, 0.5]}, [0.3, 1, 4]),
    ("transmission_scatter", {**MILK}, [BLACK, [0.3, 0.3, 0.3], [2, 1.5, 1]]),
    ("transmission_scatter_anisotropy", MILK, [-0.8, 0, 0.8]),
    ("transmission_dispersion_scale", GLASS, [0, 0.5, 1]),
    (
        "transmission_dispersion_abbe_number",
        {**GLASS, "transmission_dispersion_scale": 1},
        [9, 20, 60],
    ),
    ("transmission_tint", GLASS, [WHITE, [0.3, 0.8, 0.5], [0.8, 0.2, 0.1]]),
    ("subsurface_weight", {**SKIN, "base_color": [0.2, 0.3, 0.6]}, [0, 0.5, 1]),
    ("subsurface_color", SKIN, [[0.9, 0.9, 0.9], [0.9, 0.5, 0.35], [0.3, 0.7, 0.3]]),
    ("subsurface_radius", SKIN, [0.02, 0.2, 1]),
    (
        "subsurface_radius_scale",
        {**SKIN, "subsurface_color": [0.8, 0.8, 0.8]},
        [WHITE, [1, 0.5, 0.25], [0.1, 0.3, 1]],
    ),
    ("subsurface_scatter_anisotropy", SKIN, [-0.8, 0, 0.8]),
    ("subsurface_scatter_anisotropy", {**SKIN, "geometry_thin_walled": True}, [-1, 0, 1]),
    ("coat_weight", COATED, [0, 0.5, 1]),
    ("coat_color", COATED, [WHITE, [0.9, 0.6, 0.2], [0.2, 0.4, 0.8]]),
    ("coat_roughness", COATED, [0, 0.3, 0.7]),
    ("coat_roughness_anisotropy", {**COATED, "coat_roughness": 0.4, "coat_ior": 2}, [0, 0.5, 1]),
    ("coat_ior", COATED, [1.2, 1.6, 2.2]),
    ("coat_darkening", {**COATED, "coat_ior": 2}, [0, 0.5, 1]),
    ("fuzz_weight", PLASTIC, [0, 0.5, 1]),
    ("fuzz_color", FUZZY, [WHITE, [0.3, 0.4, 1], [1, 0.5, 0.2]]),
    ("fuzz_roughness", FUZZY, [0.2, 0.5, 1]),
    ("thin_film_weight", FILMED, [0, 0.5, 1]),
    ("thin_film_thickness", FILMED, [0.25, 0.5, 0.9]),
    (
        "thin_film_thickness",
        {**METAL, "thin_film_weight": 1, "specular_roughness": 0.15},
        [0.15, 0.4, 0.7],
    ),
    (
        "thin_film_thickness",
        {**SHEET, "thin_film_weight": 1, "thin_film_ior": 1.33},
        [0.3, 0.5, 0.8],
    ),
    ("thin_film_ior", FILMED, [1.2, 1.4, 2.0]),
    ("emission_luminance", PLASTIC, [0, 0.5, 4]),
    ("emission_color", {**PLASTIC, "emission_luminance": 2}, [WHITE, [1, 0.5, 0.1], [0.1, 0.3, 1]]),
    ("geometry_opacity", PLASTIC, [0.2, 0.6, 1]),
    (
        "geometry_thin_walled",
        {**GLASS, "transmission_color": [0.3, 0.8, 0.5], "transmission_depth": 0},
        [False, True, True],
    ),
    ("transmission_color", SHEET, [WHITE, [0.3, 0.8, 0.5], [0.8, 0.2, 0.1]]),
]

METALS = ["Ag", "Al", "Au", "Cr", "Cu", "Fe", "Ni", "Pt", "Ti", "W"]
BALLS = ["gold", "glass", "red plastic"]


class Renderer:
    """`snell render` into a temporary folder."""

    def __init__(self, snell: str, spp: int, folder: Path) -> None:
        self.snell, self.spp, self.folder, self.count = snell, spp, folder, 0

    def __call__(self, scene: str | Path, *options: str) -> Path | None:
        self.count += 1
        out = self.folder / f"{self.count}.png"
        size = f"{TILE[0]}x{TILE[1]}"
        command = [
            self.snell,
            "render",
            str(scene),
            "--size",
            size,
            "--spp",
            str(self.spp),
            "-q",
            "-o",
            str(out),
            *options,
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{scene}: {done.stderr.strip()[:400]}")
            return None
        return out


def authored(value: object) -> object:
    return value if isinstance(value, bool) else {"factor": value, "texture": None}


def open_pbr(render: Renderer, only: str) -> Sheet:
    sheet = Sheet(TILE)
    for name, others, values in SWEEPS:
        if only not in f"openpbr {name}":
            continue
        options: list[str] = []
        for ball, value in zip(BALLS, values, strict=False):
            parameters = {**others, name: value}
            # Emission and opacity belong to the material.
            luminance, tint = (
                parameters.pop("emission_luminance", 0),
                parameters.pop("emission_color", WHITE),
            )
            opacity = parameters.pop("geometry_opacity", 1)
            kind = {"material": "open-pbr", **{k: authored(v) for k, v in parameters.items()}}
            options += ["-D", f"material.{ball}.kind={json.dumps(kind)}"]
            if luminance:
                emission = authored([luminance * x for x in tint])
                options += ["-D", f"material.{ball}.emission={json.dumps(emission)}"]
            if opacity < 1:
                options += [
                    "-D",
                    f"material.{ball}.alpha={json.dumps(authored(opacity))}",
                    "-D",
                    f"material.{ball}.alpha_mode=blend",
                ]
        if "dispersion" in name:
            options += ["--color", "spectral"]
        if picture := render("spheres", *options):
            values_shown = ", ".join(json.dumps(v) for v in values)
            sheet.add(f"{name} {values_shown} of {kind_of(others)}", picture)
    return sheet


def kind_of(others: dict) -> str:
    known = {
        "metal": METAL,
        "glass": GLASS,
        "plastic": PLASTIC,
        "milk": MILK,
        "skin": SKIN,
        "coated": COATED,
        "fuzzy": FUZZY,
    }
    return next((name for name, other in known.items() if other == others), "other")


def metals(render: Renderer, only: str) -> Sheet:
    sheet = Sheet(TILE)
    for color in ("rgb", "spectral"):
        for metal in METALS:
            if only not in f"metals {metal}":
                continue
            options = ["--color", color]
            for ball, roughness in zip(BALLS, (0, 0.3, 0.7), strict=True):
                kind = {
                    "material": "conductor",
                    "spectrum": {"metal": metal},
                    "roughness": authored(roughness),
                }
                options += ["-D", f"material.{ball}.kind={json.dumps(kind)}"]
            if picture := render("spheres", *options):
                sheet.add(f"{metal}, roughness 0, 0.3, 0.7, {color}", picture)
    return sheet


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the sheets go")
    parser.add_argument("--snell", default="snell", help="the command")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--only", default="", help="only what has this in its name")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        render = Renderer(options.snell, options.spp, Path(temporary))
        sheets = {
            "open-pbr": open_pbr(render, options.only),
            "metals": metals(render, options.only),
        }
    for name, sheet in sheets.items():
        if sheet.tiles:
            sheet.save(options.folder / f"{name}.png")


if __name__ == "__main__":
    main()
