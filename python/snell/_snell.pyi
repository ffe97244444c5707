"""The compiled half of the package. Its docstrings are in the module itself."""

from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from typing import Any, Literal, final, overload, type_check_only

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray
from typing_extensions import Self

from snell._views import Mesh, Node

__all__ = [
    "INVALID_ID",
    "LIGHTS",
    "MATERIALS",
    "MEDIA",
    "PATTERNS",
    "PROJECTIONS",
    "SHAPES",
    "Camera",
    "Channel",
    "ClosestPoints",
    "Hits",
    "Image",
    "Intersections",
    "Light",
    "Material",
    "Medium",
    "Pattern",
    "Scene",
    "Texture",
    "View",
    "_Film",
    "_Render",
    "_Worker",
    "__version__",
    "_body_points",
    "_closest_pair",
    "_collides",
    "_compare",
    "_explain",
    "_irradiance",
    "_load_points",
    "_load_stage",
    "_pack_scene",
    "_render_settings",
    "_restore",
    "_restore_camera",
    "_restore_image",
    "_restore_light",
    "_restore_material",
    "_restore_medium",
    "_restore_pattern",
    "_restore_texture",
    "_run_command",
    "_time_of_impact",
    "_unpack_scene",
    "_upright",
    "_view",
    "_write_file",
    "describe",
    "load",
]

INVALID_ID: int
SHAPES: dict[str, tuple[str, ...]]
MATERIALS: dict[str, tuple[str, ...]]
PATTERNS: dict[str, tuple[str, ...]]
MEDIA: dict[str, tuple[str, ...]]
LIGHTS: dict[str, tuple[str, ...]]
PROJECTIONS: dict[str, tuple[str, ...]]

def describe(family: str, kind: str) -> dict[str, dict[str, Any]]: ...

__version__: str

# Anything that converts to an array: also what has ``__array_interface__`` or ``__dlpack__``.
_Array = ArrayLike | Any
_Objects = int | str | Sequence[int | str] | NDArray[Any]
# A number, three numbers (linear), "#rrggbb" (sRGB), or what is like them.
_Color = float | Sequence[float] | str | Any
_Floats = NDArray[np.float32] | NDArray[np.float64]

def load(
    path: str | PathLike[str], *, threads: int | None = None, confine: bool = False
) -> Scene: ...
def _irradiance(
    scene: Scene,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    texels: list[tuple[int, int]],
    options: dict[str, Any],
) -> NDArray[np.float32]: ...
def _load_points(
    path: str | PathLike[str],
) -> tuple[list[tuple[str, NDArray[Any]]], tuple[int, int]]: ...
def _load_stage(name: str, text: str) -> Scene: ...
def _compare(reference: Any, test: Any) -> tuple[dict[str, Any], NDArray[np.float32]]: ...
def _restore_image(
    picture: tuple[Any, ...],
    variance: tuple[Any, ...] | None,
    look: tuple[float, str, bool],
    facts: dict[str, Any],
    receipt: str | None = None,
) -> Image: ...
def _render_settings() -> dict[str, dict[str, Any]]: ...
def _explain(
    scene: Scene,
    options: dict[str, Any],
    pixel: tuple[int, int],
    sample: int | None,
    followed: list[str],
) -> str: ...
def _run_command(arguments: Sequence[str], python: str | None) -> int: ...
def _view(scene: Scene, options: dict[str, Any], port: int, frames_per_second: float) -> View: ...
def _body_points(scene: Scene, name: str) -> NDArray[np.float64]: ...
def _closest_pair(
    a: Scene,
    b: Scene,
    transform_a: _Array | None,
    transform_b: _Array | None,
    max_distance: float | None,
    threads: int | None,
) -> tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.uint32],
    NDArray[np.uint32],
    NDArray[np.uint32],
    NDArray[np.uint32],
    NDArray[np.str_],
]: ...
def _collides(
    a: Scene,
    b: Scene,
    transform_a: _Array | None,
    transform_b: _Array | None,
    threads: int | None,
) -> NDArray[np.bool_]: ...
def _time_of_impact(
    a: Scene,
    b: Scene,
    motion: _Array,
    transform_b: _Array | None,
    tolerance: float | None,
    threads: int | None,
) -> NDArray[np.float64]: ...
def _upright(up: str | _Array, name: str = "up") -> NDArray[np.float64]: ...
def _write_file(path: str | PathLike[str], header: bytes, data: NDArray[np.uint8]) -> None: ...
def _restore_camera(json: str) -> Camera: ...
def _restore_light(
    json: str,
    textures: list[Texture | Pattern],
    media: list[Medium],
    arrays: dict[str, NDArray[Any]],
) -> Light: ...
def _restore_material(
    json: str,
    textures: list[Texture | Pattern],
    media: list[Medium],
    arrays: dict[str, NDArray[Any]],
) -> Material: ...
def _restore_medium(
    json: str,
    textures: list[Texture | Pattern],
    media: list[Medium],
    arrays: dict[str, NDArray[Any]],
) -> Medium: ...
def _restore_texture(pixels: NDArray[Any], srgb: bool, declared: str) -> Texture: ...
def _restore_pattern(
    json: str,
    textures: list[Texture | Pattern],
    media: list[Medium],
    arrays: dict[str, NDArray[Any]],
) -> Pattern: ...
def _restore(
    scenes: list[tuple[list[dict[str, Any] | None], int, bool]],
    stages: list[tuple[bytes, list[tuple[str, int]]]],
) -> Scene: ...

@final
class View:
    def close(self) -> None: ...
    def _url_for_browser(self) -> str: ...
    @property
    def url(self) -> str: ...
    @property
    def is_open(self) -> bool: ...
    def __enter__(self) -> View: ...
    def __exit__(self, *_raised: object) -> None: ...
    def _repr_html_(self) -> str: ...

@final
class Scene:
    def __new__(cls) -> Scene: ...
    def add_mesh(
        self,
        vertices: _Array,
        faces: _Array | None = None,
        transform: _Array | None = None,
        name: str | None = None,
        *,
        mask: int | None = None,
        normals: _Array | None = None,
        uvs: _Array | None = None,
        colors: _Array | None = None,
        material: Material | list[Material] | None = None,
        material_ids: _Array | None = None,
        times: _Array | None = None,
    ) -> int: ...
    def add_shape(
        self,
        shape: str,
        transform: _Array | None = None,
        name: str | None = None,
        *,
        mask: int | None = None,
        material: Material | None = None,
        times: _Array | None = None,
        **parameters: Any,
    ) -> int: ...
    def add_curves(
        self,
        points: _Array,
        radii: _Array,
        strands: _Array | None = None,
        basis: str = "bezier",
        transform: _Array | None = None,
        name: str | None = None,
        *,
        mask: int | None = None,
        material: Material | None = None,
        times: _Array | None = None,
    ) -> int: ...
    def add_spheres(
        self,
        centers: _Array,
        radii: _Array,
        transform: _Array | None = None,
        name: str | None = None,
        *,
        mask: int | None = None,
        material: Material | None = None,
        times: _Array | None = None,
    ) -> int: ...
    def add_heightfield(
        self,
        z: _Array,
        transform: _Array | None = None,
        name: str | None = None,
        *,
        smooth: bool = False,
        edges: Literal["open", "closed"] = "open",
        mask: int | None = None,
        material: Material | None = None,
    ) -> int: ...
    def add_instance(
        self,
        scene: Scene,
        transform: _Array | None = None,
        name: str | None = None,
        *,
        mask: int | None = None,
        material: Material | None = None,
        times: _Array | None = None,
    ) -> int: ...
    def add_instances(
        self,
        scene: Scene,
        transforms: _Array,
        names: Sequence[str | None] | None = None,
        *,
        mask: int | None = None,
        material: Material | None = None,
        times: _Array | None = None,
    ) -> NDArray[np.uint32]: ...
    def update_transform(self, id: int, transform: _Array, times: _Array | None = None) -> None: ...
    def update_transforms(
        self, ids: _Array, transforms: _Array, times: _Array | None = None
    ) -> None: ...
    def at(self, time: float) -> Scene: ...
    def update_vertices(self, id: int, vertices: _Array, normals: _Array | None = None) -> None: ...
    def update_heights(self, id: int, z: _Array) -> None: ...
    def update_mask(self, id: int, mask: int) -> None: ...
    def remove(self, id: int) -> None: ...
    def mesh(self, id: int) -> Mesh: ...
    def shape(self, id: int) -> dict[str, Any]: ...
    def spheres(self, id: int) -> dict[str, Any]: ...
    def curves(self, id: int) -> dict[str, Any]: ...
    def instance(self, id: int) -> Scene: ...
    @property
    def children(self) -> list[Node]: ...
    def walk(self) -> Iterator[tuple[tuple[int, ...], Node, NDArray[np.float64]]]: ...
    def _materials(self, id: int) -> list[Material | None]: ...
    def update_name(self, id: int, name: str | None) -> None: ...
    def __getitem__(self, name: str, /) -> int: ...
    def transform(self, id: int) -> NDArray[np.float64]: ...
    def motion(self, id: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None: ...
    def show(self, **options: Any) -> View: ...
    def _repr_png_(self) -> bytes | None: ...
    @property
    def ids(self) -> list[int]: ...
    @property
    def names(self) -> dict[int, str]: ...
    @names.setter
    def names(self, names: dict[int, str]) -> None: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    @property
    def compact(self) -> bool: ...
    @compact.setter
    def compact(self, value: bool) -> None: ...
    def __len__(self) -> int: ...
    def commit(self, dtype: DTypeLike | None = None) -> None: ...
    def statistics(self, dtype: DTypeLike | None = None) -> dict[str, int]: ...
    def cast_rays(
        self,
        rays: _Array | tuple[_Array, _Array],
        *,
        t_min: _Array | None = None,
        t_max: _Array | None = None,
        mask: _Array | None = None,
        times: _Array | None = None,
        cull: Literal["back", "front"] | None = None,
        only: _Objects | None = None,
        exclude: _Objects | None = None,
        threads: int | None = None,
        progress: bool | Callable[[int, int], object] | None = None,
        warn_invalid: bool = False,
    ) -> Hits: ...
    def test_occlusions(
        self,
        rays: _Array | tuple[_Array, _Array],
        *,
        t_min: _Array | None = None,
        t_max: _Array | None = None,
        mask: _Array | None = None,
        times: _Array | None = None,
        cull: Literal["back", "front"] | None = None,
        only: _Objects | None = None,
        exclude: _Objects | None = None,
        threads: int | None = None,
        progress: bool | Callable[[int, int], object] | None = None,
        warn_invalid: bool = False,
    ) -> NDArray[np.bool_]: ...
    def count_intersections(
        self,
        rays: _Array | tuple[_Array, _Array],
        *,
        t_min: _Array | None = None,
        t_max: _Array | None = None,
        mask: _Array | None = None,
        times: _Array | None = None,
        cull: Literal["back", "front"] | None = None,
        only: _Objects | None = None,
        exclude: _Objects | None = None,
        max_hits: int | None = None,
        threads: int | None = None,
        progress: bool | Callable[[int, int], object] | None = None,
        warn_invalid: bool = False,
    ) -> NDArray[np.uint32]: ...
    def list_intersections(
        self,
        rays: _Array | tuple[_Array, _Array],
        *,
        t_min: _Array | None = None,
        t_max: _Array | None = None,
        mask: _Array | None = None,
        times: _Array | None = None,
        cull: Literal["back", "front"] | None = None,
        only: _Objects | None = None,
        exclude: _Objects | None = None,
        max_hits: int | None = None,
        threads: int | None = None,
        progress: bool | Callable[[int, int], object] | None = None,
        warn_invalid: bool = False,
    ) -> Intersections: ...
    def closest_points(
        self,
        points: _Array,
        *,
        max_distance: _Array | None = None,
        mask: int | None = None,
        threads: int | None = None,
    ) -> ClosestPoints: ...
    def distance(
        self,
        points: _Array,
        *,
        max_distance: _Array | None = None,
        mask: int | None = None,
        threads: int | None = None,
    ) -> Any: ...
    def signed_distance(
        self,
        points: _Array,
        *,
        max_distance: _Array | None = None,
        method: Literal["auto", "parity", "winding"] = "auto",
        mask: int | None = None,
        threads: int | None = None,
    ) -> Any: ...
    def occupancy(
        self,
        points: _Array,
        *,
        method: Literal["auto", "parity", "winding"] = "auto",
        mask: int | None = None,
        threads: int | None = None,
    ) -> NDArray[np.bool_]: ...
    def winding_number(
        self, points: _Array, *, mask: int | None = None, threads: int | None = None
    ) -> NDArray[np.float64]: ...
    def create_rays_camera(
        self,
        camera: Camera | int | str | None = None,
        width_px: int | None = None,
        height_px: int | None = None,
        dtype: DTypeLike | None = None,
    ) -> NDArray[Any]: ...
    @property
    def name(self) -> str: ...
    @name.setter
    def name(self, name: str) -> None: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def materials(self) -> list[Material]: ...
    def replace_material(self, material: int | str, new: Material) -> None: ...
    def update_material(self, id: int, material: Material | list[Material]) -> None: ...
    @property
    def lights(self) -> list[Light]: ...
    @lights.setter
    def lights(self, lights: Sequence[Light]) -> None: ...
    def add_light(self, light: Light) -> int: ...
    @property
    def cameras(self) -> list[Camera]: ...
    @cameras.setter
    def cameras(self, cameras: Sequence[Camera]) -> None: ...
    def add_camera(self, camera: Camera) -> int: ...
    @property
    def up(self) -> str | NDArray[np.float64]: ...
    @up.setter
    def up(self, value: str | _Array) -> None: ...
    @property
    def environment(self) -> Any: ...
    @environment.setter
    def environment(self, value: Any) -> None: ...
    def set_environment(
        self, value: Any, *, scale: _Color | None = None, transform: _Array | None = None
    ) -> None: ...
    def set_sky(
        self,
        sun: _Array,
        *,
        turbidity: float = 3.0,
        ground: float = 0.2,
        size: float = 0.53,
        scale: float = 1.0,
    ) -> None: ...
    @property
    def medium(self) -> Medium | None: ...
    @medium.setter
    def medium(self, medium: Medium | None) -> None: ...
    @property
    def background(self) -> str | tuple[float, float, float]: ...
    @background.setter
    def background(self, value: _Color) -> None: ...
    def save(self, path: str | PathLike[str], *, threads: int | None = None) -> None: ...
    def __copy__(self) -> Scene: ...
    def __deepcopy__(self, _memo: Any) -> Scene: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

# What all answers have in common. (At run time there is no such class.)
@type_check_only
class _Answers:
    @property
    def albedo(self) -> _Floats: ...
    @property
    def geometry_ids(self) -> NDArray[np.uint32]: ...
    @property
    def instance_ids(self) -> NDArray[np.uint32]: ...
    @property
    def instance_paths(self) -> NDArray[np.uint32]: ...
    @property
    def material_ids(self) -> NDArray[np.uint32]: ...
    @property
    def names(self) -> NDArray[np.str_]: ...
    @property
    def primitive_ids(self) -> NDArray[np.uint32]: ...
    @property
    def primitive_uvs(self) -> _Floats: ...
    @property
    def primitive_normals(self) -> _Floats: ...
    @property
    def points(self) -> _Floats: ...
    @property
    def normals(self) -> _Floats: ...
    @property
    def uvs(self) -> _Floats: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    @overload
    def __getitem__(self, key: str, /) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, key: Any, /) -> Self: ...
    def __len__(self) -> int: ...
    def __contains__(self, name: object, /) -> bool: ...
    def __iter__(self) -> Iterator[str]: ...
    def keys(self) -> list[str]: ...
    def values(self) -> list[NDArray[Any]]: ...
    def items(self) -> list[tuple[str, NDArray[Any]]]: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Hits(_Answers):
    def __new__(cls, arrays: dict[str, NDArray[Any]]) -> Hits: ...
    @property
    def is_hit(self) -> NDArray[np.bool_]: ...
    @property
    def is_entering(self) -> NDArray[np.bool_]: ...
    @property
    def t_hit(self) -> _Floats: ...
    def spawn_rays(self, directions: _Array) -> _Floats: ...

@final
class Intersections(_Answers):
    def __new__(cls, arrays: dict[str, NDArray[Any]]) -> Intersections: ...
    @property
    def is_entering(self) -> NDArray[np.bool_]: ...
    @property
    def ray_splits(self) -> NDArray[np.int64]: ...
    @property
    def ray_ids(self) -> NDArray[np.int64]: ...
    @property
    def t_hit(self) -> _Floats: ...

@final
class ClosestPoints(_Answers):
    def __new__(cls, arrays: dict[str, NDArray[Any]]) -> ClosestPoints: ...
    @property
    def distances(self) -> _Floats: ...

@final
class Image:
    def __new__(cls, pixels: _Array) -> Image: ...
    @staticmethod
    def open(path: str | PathLike[str]) -> Image: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def pixels(self) -> NDArray[np.float32]: ...
    @property
    def aovs(self) -> dict[str, NDArray[Any]]: ...
    @property
    def variance(self) -> NDArray[np.float32] | None: ...
    @property
    def metadata(self) -> dict[str, Any]: ...
    def to_uint8(
        self, *, exposure: float | None = None, tonemap: str | None = None
    ) -> NDArray[np.uint8]: ...
    def save(
        self,
        path: str | PathLike[str],
        *,
        exposure: float | None = None,
        tonemap: str | None = None,
        bits: int = 8,
        half: bool = False,
        variance: bool = False,
        threads: int | None = None,
    ) -> None: ...
    def __array__(
        self, dtype: DTypeLike | None = None, copy: bool | None = None
    ) -> NDArray[Any]: ...
    def _repr_png_(self) -> bytes: ...
    def __copy__(self) -> Image: ...
    def __deepcopy__(self, _memo: Any) -> Image: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class _Render:
    def __new__(
        cls,
        scene: Scene,
        options: dict[str, Any],
        checkpoint: tuple[str | PathLike[str], float, bool] | None = None,
    ) -> _Render: ...
    def save(self) -> None: ...
    @property
    def samples(self) -> int: ...
    @property
    def taken(self) -> int: ...
    @property
    def is_done(self) -> bool: ...
    def render(
        self, samples: int | None = None, time: float | None = None, report: Any | None = None
    ) -> Image: ...

@final
class _Film:
    def __new__(cls, scene: Scene, options: dict[str, Any], name: str) -> _Film: ...
    @property
    def has_rounds(self) -> bool: ...
    @property
    def is_guided(self) -> bool: ...
    @property
    def progress(self) -> tuple[float, int]: ...
    def tasks(self, count: int, samples: int) -> list[bytes]: ...
    def add(self, result: bytes) -> None: ...
    def end_round(self) -> None: ...
    def picture(self) -> Image: ...

@final
class _Worker:
    def __new__(cls, scene: Scene, options: dict[str, Any], name: str) -> _Worker: ...
    def train(self, is_wanted: Callable[[], bool] | None = None) -> bytes | None: ...
    def learn(self, field: bytes) -> None: ...
    def perform(
        self, task: bytes, worker: str, is_wanted: Callable[[], bool] | None = None
    ) -> bytes | None: ...

def _pack_scene(scene: Scene) -> bytes: ...
def _unpack_scene(packed: bytes, threads: int | None) -> Scene: ...

@final
class Camera:
    def __new__(
        cls,
        projection: str = "perspective",
        /,
        *,
        eye: _Array,
        target: _Array | None = None,
        towards: _Array | None = None,
        up: _Array | None = None,
        fov: float | None = None,
        aperture_radius: float = 0.0,
        focus_distance: float | None = None,
        resolution: Sequence[int] | None = None,
        clip: Sequence[float] | None = None,
        name: str | None = None,
        **parameters: Any,
    ) -> Camera: ...
    @staticmethod
    def from_opencv(
        K: _Array,
        T_world_cam: _Array | None = None,
        *,
        distortion: _Array | None = None,
        size: Sequence[int] | None = None,
        T_cam_world: _Array | None = None,
        rvec: _Array | None = None,
        tvec: _Array | None = None,
        fisheye: _Array | None = None,
        name: str | None = None,
    ) -> Camera: ...
    @staticmethod
    def from_matrix(
        T_world_cam: _Array,
        axes: str,
        *,
        projection: str = "perspective",
        fov: float | None = None,
        resolution: Sequence[int] | None = None,
        clip: Sequence[float] | None = None,
        name: str | None = None,
        **parameters: Any,
    ) -> Camera: ...
    def matrix(self, axes: str) -> NDArray[np.float64]: ...
    @property
    def kind(self) -> str: ...
    @property
    def parameters(self) -> dict[str, Any]: ...
    def replace(
        self,
        *,
        eye: _Array | None = None,
        target: _Array | None = None,
        towards: _Array | None = None,
        up: _Array | None = None,
        fov: float | None = None,
        aperture_radius: float | None = None,
        focus_distance: float | None = None,
        resolution: Sequence[int] | None = None,
        clip: Sequence[float] | None = None,
        name: str | None = None,
        **parameters: Any,
    ) -> Camera: ...
    def __replace__(self, **changes: Any) -> Camera: ...
    def rays(
        self,
        width_px: int | None = None,
        height_px: int | None = None,
        dtype: DTypeLike | None = None,
    ) -> NDArray[Any]: ...
    def project(self, points: _Array, size: Sequence[int]) -> NDArray[np.float64]: ...
    def __getattr__(self, name: str, /) -> Any: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

# What all declared things have in common. (At run time there is no such class.)
@type_check_only
class _Declared:
    def __new__(cls, kind: str, /, **parameters: Any) -> Self: ...
    @property
    def kind(self) -> str: ...
    @property
    def parameters(self) -> dict[str, Any]: ...
    def replace(self, **changes: Any) -> Self: ...
    def __getattr__(self, name: str, /) -> Any: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Light(_Declared): ...

@final
class Material(_Declared): ...

@final
class Medium(_Declared): ...

@final
class Pattern(_Declared): ...

@final
class Texture:
    def __new__(cls, image: _Array | Image | str | PathLike[str], **parameters: Any) -> Texture: ...
    @property
    def size(self) -> list[int]: ...
    def channel(self, channel: str | int) -> Channel: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Channel:
    @property
    def texture(self) -> Texture: ...
    @property
    def number(self) -> int: ...
