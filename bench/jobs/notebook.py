"""A cell of a notebook without a display: the picture that it shows, as PNG, and which pixels show
the part. Beside PyVista.
"""

import io

import numpy as np
import pyvista as pv
from common import Outcome, beside, torus
from PIL import Image

import snell

SIZE = (320, 240)


def ours(vertices, faces):
    scene = snell.Scene()
    scene.add_mesh(vertices, faces)
    camera = snell.Camera(eye=(0, -4, 3), target=(0, 0, 0), up=(0, 0, 1), fov=35)
    image = snell.render(scene, "flat", 1, SIZE, camera=camera, aovs=["depth"], progress=False)
    assert image._repr_png_().startswith(b"\x89PNG")
    return image.aovs["depth"] > 0


def theirs(vertices, faces):
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.add_mesh(pv.PolyData.from_regular_faces(vertices, faces))
    plotter.camera_position = [(0, -4, 3), (0, 0, 0), (0, 0, 1)]
    plotter.camera.view_angle = 35
    pixels = plotter.screenshot(return_img=True)
    Image.fromarray(pixels).save(png := io.BytesIO(), "PNG")
    assert png.getvalue().startswith(b"\x89PNG")
    return np.isfinite(plotter.get_image_depth())


def run() -> Outcome:
    return beside("a picture in a notebook", "PyVista", ours, theirs, *torus())
