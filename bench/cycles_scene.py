"""Cycles as a renderer of the scenes that `render_speed.py` writes. Needs `pip install bpy`.

Reads what those files hold and nothing else: rectangles, cubes, spheres (as fine meshes: Cycles has
no others), OBJ; matte and clear surfaces, lamps, a constant sky, one homogeneous medium. Times are
those of all samples but the first, so that what Cycles prepares for each picture is not in them.
"""

from __future__ import annotations

import tempfile
import time
import xml.etree.ElementTree as xml
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

AXES = "xyz"


def numbers(text: str) -> list[float]:
    return [float(part) for part in text.replace(",", " ").split()]


def value(element: xml.Element, kind: str, name: str) -> list[float] | None:
    found = element.find(f"{kind}[@name='{name}']")
    return None if found is None else numbers(found.get("value", ""))


def placed(transform: xml.Element | None) -> Matrix:
    matrix = Matrix.Identity(4)
    for step in [] if transform is None else list(transform):
        if step.tag == "rotate":
            axis = Vector([float(step.get(a, 0)) for a in AXES])
            move = Matrix.Rotation(np.radians(float(step.get("angle", 0))), 4, axis)
        elif step.tag == "scale":
            sides = (
                numbers(step.get("value", "")) * 3
                if step.get("value")
                else [float(step.get(a, 1)) for a in AXES]
            )
            move = Matrix.Diagonal((*sides[:3], 1))
        else:
            move = Matrix.Translation([float(step.get(a, 0)) for a in AXES])
        matrix = move @ matrix
    return matrix


def obj(file: Path) -> tuple[list[list[float]], list[list[int]]]:
    lines = [line.split() for line in file.read_text().splitlines()]
    points = [[float(x) for x in parts[1:4]] for parts in lines if parts[:1] == ["v"]]
    faces = [
        [int(corner.split("/")[0]) - 1 for corner in parts[1:]]
        for parts in lines
        if parts[:1] == ["f"]
    ]
    return points, faces


class Cycles:
    def __init__(self, threads: int) -> None:
        self.name, self.threads, self.file = "cycles", threads, None

    def knows(self, file: Path) -> bool:
        """Whether it has what the scene asks for: rough metal, plastic, paint and frost are other
        models there.
        """
        return {bsdf.get("type") for bsdf in xml.parse(file).iter("bsdf")} <= {
            "twosided",
            "diffuse",
            "dielectric",
            "null",
        }

    def render(self, file: Path, spp: int, seed: int) -> tuple[np.ndarray, float]:
        if self.file != file:
            self.load(file)
            self.file = file
            self.picture(1, 999)
        _, first = self.picture(1, seed)
        picture, whole = self.picture(spp, seed)
        return picture, (whole - first) * spp / (spp - 1)

    def picture(self, spp: int, seed: int) -> tuple[np.ndarray, float]:
        scene = bpy.context.scene
        scene.cycles.samples, scene.cycles.seed = spp, seed
        with tempfile.TemporaryDirectory() as folder:
            scene.render.filepath = str(Path(folder) / "picture.exr")
            start = time.perf_counter()
            bpy.ops.render.render(write_still=True)
            seconds = time.perf_counter() - start
            image = bpy.data.images.load(scene.render.filepath)
            pixels = np.array(image.pixels[:], dtype=np.float64).reshape(
                image.size[1], image.size[0], -1
            )
            bpy.data.images.remove(image)
        return pixels[::-1, :, :3], seconds

    def load(self, file: Path) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        root = xml.parse(file).getroot()
        sensor, depth = root.find("sensor"), int(root.find("integrator/integer").get("value", "8"))
        self.settings(int(sensor.find("film/integer").get("value", "512")), depth - 1)
        look = sensor.find("transform/lookat")
        eye, target, up = (
            Vector(numbers(look.get(name, ""))) for name in ("origin", "target", "up")
        )
        back = (eye - target).normalized()
        right = up.cross(back).normalized()
        camera = bpy.data.cameras.new("camera")
        camera.angle = np.radians(value(sensor, "float", "fov")[0])
        seen_by = bpy.data.objects.new("camera", camera)
        seen_by.matrix_world = Matrix((right, back.cross(right), back)).transposed().to_4x4()
        seen_by.matrix_world.translation = eye
        bpy.context.collection.objects.link(seen_by)
        bpy.context.scene.camera = seen_by
        world = bpy.context.scene.world = bpy.data.worlds.new("world")
        world.use_nodes = True
        sky = root.find("emitter[@type='constant']")
        color = [0.0] * 3 if sky is None else value(sky, "rgb", "radiance")
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (*color, 1)
        for shape in root.findall("shape"):
            self.shape(shape)

    def settings(self, side: int, bounces: int) -> None:
        scene = bpy.context.scene
        scene.render.engine, cycles = "CYCLES", scene.cycles
        scene.render.resolution_x = scene.render.resolution_y = side
        scene.render.threads_mode, scene.render.threads = "FIXED", self.threads
        scene.render.use_persistent_data = True
        scene.render.image_settings.file_format, scene.render.image_settings.color_depth = (
            "OPEN_EXR",
            "32",
        )
        cycles.use_adaptive_sampling, cycles.use_denoising, cycles.pixel_filter_type = (
            False,
            False,
            "BOX",
        )
        cycles.filter_width = 1.0
        cycles.sample_clamp_indirect = cycles.sample_clamp_direct = cycles.blur_glossy = 0.0
        for kind in ("", "diffuse_", "glossy_", "transmission_", "volume_", "transparent_"):
            setattr(
                cycles,
                f"{kind}max_bounces" if kind in ("", "transparent_") else f"{kind}bounces",
                bounces,
            )

    def shape(self, shape: xml.Element) -> None:
        kind, mesh = shape.get("type"), bpy.data.meshes.new("shape")
        if kind == "obj":
            points, faces = obj(Path(shape.find("string").get("value", "")))
            mesh.from_pydata(points, [], faces)
        elif kind == "rectangle":
            mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
        else:
            import bmesh

            made = bmesh.new()
            if kind == "cube":
                bmesh.ops.create_cube(made, size=2)
            else:
                bmesh.ops.create_icosphere(made, subdivisions=7, radius=1)
            made.to_mesh(mesh)
        if kind in ("sphere", "obj"):
            mesh.shade_smooth()
        mesh.materials.append(self.material(shape))
        thing = bpy.data.objects.new("shape", mesh)
        thing.matrix_world = placed(shape.find("transform"))
        bpy.context.collection.objects.link(thing)

    def material(self, shape: xml.Element) -> bpy.types.Material:
        material = bpy.data.materials.new("material")
        material.use_nodes = True
        nodes, links = material.node_tree.nodes, material.node_tree.links
        nodes.clear()
        output = nodes.new("ShaderNodeOutputMaterial")
        emitter, medium = shape.find("emitter"), shape.find("medium")
        if medium is not None:
            total, albedo = value(medium, "rgb", "sigma_t")[0], value(medium, "rgb", "albedo")[0]
            scatter, absorb, both = (
                nodes.new(f"ShaderNode{n}")
                for n in ("VolumeScatter", "VolumeAbsorption", "AddShader")
            )
            scatter.inputs["Color"].default_value, absorb.inputs["Color"].default_value = (
                (1, 1, 1, 1),
                (0, 0, 0, 1),
            )
            scatter.inputs["Density"].default_value, absorb.inputs["Density"].default_value = (
                total * albedo,
                total * (1 - albedo),
            )
            scatter.inputs["Anisotropy"].default_value = value(medium.find("phase"), "float", "g")[
                0
            ]
            links.new(scatter.outputs[0], both.inputs[0])
            links.new(absorb.outputs[0], both.inputs[1])
            links.new(both.outputs[0], output.inputs["Volume"])
            return material
        bsdf = shape.find("bsdf")
        if bsdf.get("type") == "dielectric":
            surface = nodes.new("ShaderNodeBsdfGlass")
            surface.inputs["Roughness"].default_value, surface.inputs["IOR"].default_value = (
                0,
                value(bsdf, "float", "int_ior")[0],
            )
        else:
            surface = nodes.new("ShaderNodeBsdfDiffuse")
            surface.inputs["Color"].default_value = (
                *value(bsdf.find("bsdf"), "rgb", "reflectance"),
                1,
            )
        if emitter is not None:
            radiance = value(emitter, "rgb", "radiance")
            front, side, either = (
                nodes.new(f"ShaderNode{n}") for n in ("Emission", "NewGeometry", "MixShader")
            )
            front.inputs["Strength"].default_value = max(radiance)
            front.inputs["Color"].default_value = (*(x / max(radiance) for x in radiance), 1)
            links.new(side.outputs["Backfacing"], either.inputs[0])
            links.new(front.outputs[0], either.inputs[1])
            links.new(surface.outputs[0], either.inputs[2])
            surface = either
        links.new(surface.outputs[0], output.inputs["Surface"])
        return material
