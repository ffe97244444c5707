"""glTF files that have materials: what extensions they use, and the materials of a file without
meshes on balls. Needs Pillow.
"""

from __future__ import annotations

import base64
import json
import math
import struct
from pathlib import Path

from PIL import Image

EXTENSIONS = [
    f"KHR_materials_{name}"
    for name in [
        "anisotropy",
        "clearcoat",
        "diffuse_transmission",
        "dispersion",
        "emissive_strength",
        "ior",
        "iridescence",
        "pbrSpecularGlossiness",
        "sheen",
        "specular",
        "transmission",
        "unlit",
        "variants",
        "volume",
    ]
]

RED = [0.7, 0.08, 0.05]


def extensions(file: Path) -> str:
    """The names of the extensions of materials in a file, without what all begin with."""
    data = file.read_bytes()
    names = {n for n in EXTENSIONS if n.encode() in data}
    return ", ".join(sorted(n.removeprefix("KHR_materials_") for n in names))


def has_materials_alone(file: Path) -> bool:
    """Whether a glTF text file has materials, and no mesh that they are on."""
    if file.suffix != ".gltf":
        return False
    try:
        scene = json.loads(file.read_bytes())
        materials = scene.get("materials")
    except (ValueError, AttributeError):
        return False
    sound = isinstance(materials, list) and all(isinstance(m, dict) for m in materials)
    return bool(materials) and sound and "meshes" not in scene


# How finely a ball is divided, around and from pole to pole.
AROUND, DOWN = 48, 24
TEXCOORDS = 8


def ball() -> tuple[bytes, bytes, bytes]:
    """Positions (its normals, too), texture coordinates and indices of a ball of radius 1."""
    positions, places, indices = bytearray(), bytearray(), bytearray()
    for row in range(DOWN + 1):
        for column in range(AROUND + 1):
            theta, phi = math.pi * row / DOWN, 2 * math.pi * column / AROUND
            positions += struct.pack(
                "<3f",
                math.sin(theta) * math.sin(phi),
                math.cos(theta),
                math.sin(theta) * math.cos(phi),
            )
            places += struct.pack("<2f", column / AROUND * 2, row / DOWN)
    for row in range(DOWN):
        for column in range(AROUND):
            here = row * (AROUND + 1) + column
            below = here + AROUND + 1
            # At the poles one of the two has no area.
            if row > 0:
                indices += struct.pack("<3H", here, below, here + 1)
            if row < DOWN - 1:
                indices += struct.pack("<3H", here + 1, below, below + 1)
    return bytes(positions), bytes(places), bytes(indices)


def on_balls(file: Path, folder: Path) -> Path:
    """A copy in `folder` of a glTF text file without meshes, in which each of its materials is on a
    ball.
    """
    scene = json.loads(file.read_bytes())
    parts = ball()
    offsets = [sum(map(len, parts[:n])) for n in range(3)]
    data = b"".join(parts)
    scene["buffers"] = [
        {
            "byteLength": len(data),
            "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
        }
    ]
    scene["bufferViews"] = [
        {"buffer": 0, "byteOffset": at, "byteLength": len(part)}
        for at, part in zip(offsets, parts, strict=True)
    ]
    points = (AROUND + 1) * (DOWN + 1)
    scene["accessors"] = [
        {
            "bufferView": 0,
            "componentType": 5126,
            "count": points,
            "type": "VEC3",
            "min": [-1, -1, -1],
            "max": [1, 1, 1],
        },
        {"bufferView": 1, "componentType": 5126, "count": points, "type": "VEC2"},
        {
            "bufferView": 2,
            "componentType": 5123,
            "count": 6 * AROUND * (DOWN - 1),
            "type": "SCALAR",
        },
    ]
    attributes = {"POSITION": 0, "NORMAL": 0} | {f"TEXCOORD_{set}": 1 for set in range(TEXCOORDS)}
    count = len(scene["materials"])
    scene["meshes"] = [
        {"primitives": [{"attributes": attributes, "indices": 2, "material": number}]}
        for number in range(count)
    ]
    row = min(count, 4)
    scene["nodes"] = [
        {"mesh": n, "translation": [2.3 * (n % row), -2.3 * (n // row), 0]} for n in range(count)
    ]
    scene["scenes"], scene["scene"] = [{"nodes": list(range(count))}], 0
    checks = folder / "checks.png"
    picture = Image.new("RGB", (64, 64))
    picture.putdata(
        [
            (230, 120, 60) if (x // 8 + y // 8) % 2 else (60, 160, 200)
            for y in range(64)
            for x in range(64)
        ]
    )
    picture.save(checks)
    for material in scene["materials"]:
        material.setdefault(
            "pbrMetallicRoughness",
            {"metallicFactor": 0, "roughnessFactor": 0.3, "baseColorFactor": [*RED, 1]},
        )
    for image in scene.get("images", []):
        named = file.parent / image.get("uri", "")
        image["uri"] = str(named.resolve()) if named.is_file() else checks.name
    copy = folder / file.name
    copy.write_text(json.dumps(scene))
    return copy
