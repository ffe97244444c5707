r"""Jobs that people do with ray casters, by Snell and by what they use: lines, seconds, answers.

    python bench/jobs/all.py [NAME...]

Needs: pip install numpy open3d "trimesh[easy]" embreex python-fcl \
        opencv-python-headless pyvista
"""

import importlib
import sys

JOBS = [
    "lidar",
    "sun_hours",
    "depth_camera",
    "signed_distance",
    "thickness",
    "ambient_occlusion",
    "clearance",
    "radiography",
    "photo_projection",
    "acoustics",
    "exercise",
    "notebook",
]


def main() -> None:
    print("| job | beside | lines | seconds | answers |\n|---|---|---|---|---|")
    for name in sys.argv[1:] or JOBS:
        done = importlib.import_module(name).run()
        seconds = " : ".join(f"{value:.3g}" for value in done.seconds)
        count = " : ".join(str(value) for value in done.lines)
        print(f"| {done.job} | {done.peer} | {count} | {seconds} | {done.agreement} |", flush=True)


if __name__ == "__main__":
    main()
