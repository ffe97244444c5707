"""Pictures of many processes have the bits of those of one, whatever happens to the processes."""

from __future__ import annotations

import collections
import hashlib
import os
import random
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import snell
import snell.distributed
from snell._snell import _Film, _pack_scene, _unpack_scene, _Worker
from snell.distributed import _engine, _frames, _render, _worker

SMALL: dict[str, Any] = {"spp": 40, "size": (72, 50)}

GROUPS = {"ceiling": "lamp", "rest": ["environment"]}

# Everything that a render may do with its film.
KINDS: dict[str, dict[str, Any]] = {
    "path": {},
    "noise": {"noise": 0.3, "spp": 200},
    "guiding": {"guiding": 2},
    "guiding and noise": {"guiding": True, "noise": 0.4, "spp": 100},
    "layers": {"aovs": "all", "light_groups": GROUPS},
    "crop": {"crop": (7, 9, 60, 33), "filter": "mitchell", "seed": 3},
    "spectral": {"color": "spectral", "sampler": "sobol"},
    "direct": {"integrator": "direct", "spp": 5},
}


def foggy() -> snell.Scene:
    scene = snell.load("cornell-box")
    scene.medium = snell.Medium("homogeneous", sigma_a=0.0002, sigma_s=0.002, emission=0, g=0.3)
    return scene


def pendulum() -> snell.Scene:
    """Things of all kinds, one of which moves."""
    scene = snell.load("cornell-box")
    inner = snell.Scene()
    inner.add_mesh(np.random.default_rng(1).random((30, 3)), np.arange(30).reshape(10, 3))
    turn = np.tile(np.diag([200, 200, 200, 1]), (3, 1, 1))
    turn[:, :3, 3] = [[100, 100, 200], [300, 200, 100], [100, 300, 300]]
    scene.add_instance(inner, turn, times=[0, 1, 2])
    scene.add_spheres([[100, 200, 300], [400, 400, 200]], 60)
    return scene


def digest(image: snell.Image) -> str:
    """The SHA-256 of all that a picture holds."""
    found = hashlib.sha256(np.asarray(image).tobytes())
    found.update(image.variance.tobytes())
    for name in sorted(image.aovs):
        found.update(name.encode() + image.aovs[name].tobytes())
    return found.hexdigest()


def facts(image: snell.Image) -> dict[str, Any]:
    """The metadata that do not depend on the machine."""
    own = ["seconds", "estimated_memory_bytes"]
    return {key: value for key, value in image.metadata.items() if key not in own}


class Inline:
    """An engine without other processes, which performs tasks in a random order, some of them
    twice. Its workers have never seen the scene before.
    """

    def __init__(self, client: Any, scene: bytes) -> None:
        self.scene, self.random = scene, random.Random(7)
        self.waiting: list[tuple[int, _worker.Job, bytes]] = []
        self.results: list[bytes] = []
        self.sent = 0
        self.fields: dict[str, bytes | None] = {}
        _worker._scenes.clear()
        _worker._workers.clear()

    def threads(self) -> int:
        return 3

    def submit(self, job: _worker.Job, task: bytes) -> int:
        self.sent += 1
        self.waiting.append((self.sent, job, task))
        return self.sent

    def wait(self, seconds: float) -> list[tuple[int, bytes]]:
        at = self.random.randrange(len(self.waiting))
        handle, job, task = self.waiting.pop(at)
        count = self.random.randrange(1, 3)
        place = _worker.Place(lambda: self.scene, count, "inline")
        if job.is_guided and job.name not in self.fields:
            self.fields[job.name] = _worker.train(job, place)
            _worker._workers.clear()
        result = _worker.perform(job, task, place, lambda: self.fields.get(job.name))
        assert result is not None
        return [(handle, result)]

    def cancel(self) -> None:
        self.waiting.clear()

    def close(self) -> None:
        pass


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_render, "Dask", Inline)
    monkeypatch.setattr(_frames, "_SAMPLES", 20_000)


class Shuffled:
    """A film that hands out its tasks in a random order, and a tenth of them twice."""

    def __init__(self, *arguments: Any) -> None:
        self.film = _Film(*arguments)
        self.seed = 0

    def tasks(self, *arguments: Any) -> list[bytes]:
        self.seed += 1
        shuffle = random.Random(self.seed)
        tasks = self.film.tasks(*arguments)
        tasks += shuffle.sample(tasks, (len(tasks) + 9) // 10)
        shuffle.shuffle(tasks)
        return tasks

    def __getattr__(self, name: str) -> Any:
        return getattr(self.film, name)


@pytest.fixture
def shuffled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_frames, "_Film", Shuffled)
    monkeypatch.setattr(_frames, "_SAMPLES", 20_000)


@pytest.mark.parametrize("kind", KINDS)
def test_bits_do_not_depend_on_tasks(kind, inline, shuffled):
    options = {**SMALL, **KINDS[kind]}
    alone = snell.render("cornell-box", **options)
    image = snell.distributed.render("cornell-box", progress=False, **options)
    assert digest(image) == digest(alone) and facts(image) == facts(alone)


def test_shared_pictures_carry_the_same_receipt(inline, tmp_path):
    receipts = []
    for number, render in enumerate((snell.render, snell.distributed.render)):
        path = tmp_path / f"{number}.exr"
        render("cornell-box", progress=False, **SMALL).save(path)
        receipts.append(snell.Image.open(path).metadata["Receipt"])
    assert receipts[0] == receipts[1]


def test_a_task_that_hangs_is_done_by_another_worker(inline, monkeypatch):
    monkeypatch.setattr(_frames, "_PATIENCE", 0.2)
    hanging: list[int] = []

    class Hanging(Inline):
        def submit(self, job: _worker.Job, task: bytes) -> int:
            handle = super().submit(job, task)
            if self.sent in (3, 4):
                hanging.append(self.waiting.pop()[0])
            return handle

        def wait(self, seconds: float) -> list[tuple[int, bytes]]:
            if self.waiting:
                return super().wait(seconds)
            time.sleep(seconds)
            return []

    monkeypatch.setattr(_render, "Dask", Hanging)
    image = snell.distributed.render("cornell-box", progress=False, **SMALL)
    assert hanging == [3, 4] and digest(image) == digest(snell.render("cornell-box", **SMALL))


SCENES = ["ball.pbrt", "patterns.pbrt", "house.obj", "pendulum.gltf", "pyramid.gltf", "balls.scn"]


@pytest.mark.parametrize("name", [*SCENES, "teapot", "fog", "things"])
def test_scenes_travel_without_loss(name, inline):
    path = os.path.join(os.path.dirname(__file__), "../../scenes", name)
    made = {"fog": foggy, "things": pendulum}
    scene = made[name]() if name in made else snell.load(path if "." in name else name)
    aovs = ["geometry-id", "position", "normal", "crypto-object"]
    options: dict[str, Any] = {"spp": 2, "size": (40, 30), "aovs": aovs}
    alone = snell.render(scene, **options)
    image = snell.distributed.render(scene, progress=False, **options)
    assert digest(image) == digest(alone) and facts(image) == facts(alone)


def test_frames_come_in_order_and_have_their_own_options(inline, shuffled):
    scene = pendulum()
    camera = scene.cameras[0]
    frames = [{"shutter": (t, t)} for t in (0, 0.5, 1)]
    frames += [{"shutter": (0, 2), "camera": camera}, {"seed": 5}]
    options = {"spp": 4, "size": (40, 30)}
    images = list(snell.distributed.render_frames(scene, iter(frames), progress=False, **options))
    alone = [digest(snell.render(scene, **options, **frame)) for frame in frames]
    assert [digest(image) for image in images] == alone and len(set(alone)) == 5
    assert list(snell.distributed.render_frames(scene, [], **options)) == []


def test_pictures_on_the_way(inline):
    seen: list[snell.Image] = []
    told: list[float] = []

    def tell(share: float, rays: int) -> None:
        told.append(share)

    image = snell.distributed.render(
        "cornell-box", progress=tell, partial=seen.append, every=0, view=False, **SMALL
    )
    assert told == sorted(told) and told[0] < 0.5 and told[-1] == 1
    assert seen and all(not picture.metadata["is_complete"] for picture in seen)
    *first, last = snell.distributed.render_iter("cornell-box", every=0, **SMALL)
    assert first and digest(last) == digest(image) and last.metadata["is_complete"]
    empty = (np.asarray(first[0]).sum(axis=-1) == 0).mean()
    assert 0.3 < empty < 1
    told.clear()
    snell.distributed.render("cornell-box", progress=tell, noise=0.5, size=(24, 24))
    assert told == sorted(told) and told[-1] == 1


def test_a_render_is_stopped_by_its_progress_an_iterator_or_an_error(inline):
    image = snell.distributed.render("cornell-box", progress=lambda *_: False, **SMALL)
    assert not image.metadata["is_complete"]
    pictures = snell.distributed.render_iter("cornell-box", every=0, **SMALL)
    next(pictures)
    pictures.close()

    def fails(share: float, rays: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        snell.distributed.render("cornell-box", progress=fails, **SMALL)


def test_a_rendering_goes_on_by_itself(inline):
    rendering = snell.distributed.start("cornell-box", **SMALL)
    assert rendering.picture().shape == (50, 72, 3) and 0 <= rendering.progress <= 1
    image = rendering.result(timeout=60)
    assert rendering.done() and image.metadata["is_complete"] and rendering.progress == 1
    assert rendering._repr_png_().startswith(b"\x89PNG")
    long = snell.distributed.start("cornell-box", size=(72, 50), spp=100_000)
    with pytest.raises(TimeoutError, match=r"not complete after 0\.1 s"):
        long.result(timeout=0.1)
    long.cancel()
    assert not long.result(timeout=60).metadata["is_complete"]
    with pytest.raises(ValueError, match="spp is 0"):
        snell.distributed.start("cornell-box", spp=0).result(timeout=60)


def test_what_cannot_be_is_said_before_workers_start(monkeypatch):
    for name in ("Dask", "Ray"):
        monkeypatch.setattr(_render, name, None)
    wrong = [
        ({"time": "30s"}, ValueError, "time is '30s', .* give spp or noise"),
        ({"engine": "spark"}, ValueError, "engine is 'spark', expected 'dask' or 'ray'"),
        ({"nois": 0.1}, TypeError, r"render\(\) got .* 'nois'; did you mean 'noise'"),
        ({"spp": 0}, ValueError, "spp is 0"),
        ({"camera": 7}, IndexError, "camera is 7"),
    ]
    for options, error, message in wrong:
        with pytest.raises(error, match=message):
            snell.distributed.render("cornell-box", **options)
    with pytest.raises(ValueError, match="time is 3"):
        list(snell.distributed.render_frames("cornell-box", [{"time": 3}]))


@pytest.mark.parametrize(("engine", "package"), [("dask", "distributed"), ("ray", "ray")])
def test_missing_packages_are_named_with_their_extra(engine, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    message = rf"needs the package '{package}' here: pip install 'snell\[{engine}\]'"
    with pytest.raises(ModuleNotFoundError, match=message):
        snell.distributed.render("cornell-box", engine=engine, **SMALL)


def test_the_package_needs_no_engine():
    code = "import sys, snell.distributed; print({'dask', 'distributed', 'ray'} & {*sys.modules})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


def test_foreign_tasks_and_results_are_refused():
    scene = snell.load("cornell-box")
    options = {"spp": 1, "size": (40, 20)}
    film, other = (_Film(scene, options, name) for name in "ab")
    worker = _Worker(scene, {**options, "threads": 1}, "a")
    tasks = film.tasks(1, 1)
    result = worker.perform(tasks[0], "the worker")
    assert result is not None and len(tasks) == 6
    film.add(result)
    rays = film.progress[1]
    film.add(result)
    assert film.progress[1] == rays > 0
    with pytest.raises(RuntimeError, match=r"not a result of this render.* the worker"):
        other.add(result)
    for broken in (b"", result[:-1], result[:40] + bytes([result[40] ^ 1]) + result[41:]):
        with pytest.raises(RuntimeError, match="not a result of this render"):
            film.add(broken)
    with pytest.raises(ValueError, match="task: "):
        worker.perform(result, "the worker")
    with pytest.raises(ValueError, match="guiding: this is not a guiding field"):
        worker.learn(result)
    elsewhere = _Film(scene, {"spp": 1, "size": (400, 200)}, "a").tasks(1, 1)
    with pytest.raises(ValueError, match="task: it is not of this render"):
        worker.perform(elsewhere[-1], "the worker")
    job = _worker.Job("a", "b", b"", "0.0.0")
    with pytest.raises(RuntimeError, match=r"this program has 0\.0\.0.*install the same version"):
        _worker.perform(job, tasks[0], _worker.Place(bytes, 1, "w"))


def test_a_worker_without_snell_is_named():
    for error in (ModuleNotFoundError("No module named 'snell'"), RuntimeError("other")):
        said = str(_engine.explain(error))
        assert ("install the version of this program" in said) == ("snell" in str(error))


def test_a_task_ends_when_it_is_not_wanted():
    scene = _unpack_scene(_pack_scene(snell.load("cornell-box")), 1)
    options = {"spp": 100_000, "size": (64, 64)}
    task = _Film(scene, options, "a").tasks(1, 1 << 60)[0]
    start = time.perf_counter()
    assert _Worker(scene, {**options, "threads": 1}, "a").perform(task, "w", lambda: False) is None
    assert time.perf_counter() - start < 10


def test_workers_keep_few_scenes():
    kept: collections.OrderedDict[str, int] = collections.OrderedDict()
    made: list[str] = []
    for name in "abacabd":
        _worker._kept(kept, name, lambda name=name: made.append(name) or len(made))
    assert "".join(made) == "abcbd" and list(kept) == ["b", "d"]


# With a scheduler and processes.

quiet = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        dashboard_address=":0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=50,
    ) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def client(cluster: Any) -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.Client(cluster, set_as_default=False) as client:
        yield client


@quiet
@pytest.mark.parametrize("kind", ["path", "noise", "guiding", "layers"])
def test_dask_gives_the_same_bits(kind, client, shuffled):
    options = {**SMALL, **KINDS[kind]}
    image = snell.distributed.render(foggy(), client, progress=False, **options)
    alone = snell.render(foggy(), **options)
    assert digest(image) == digest(alone) and facts(image) == facts(alone)


@quiet
def test_dask_loses_nothing_with_its_workers(client, monkeypatch):
    monkeypatch.setattr(_frames, "_SAMPLES", 20_000)
    killed: list[int] = []

    def kill(share: float, rays: int) -> None:
        # Both at once too, so that no worker has the scene.
        if share > 0.15 * (len(killed) + 1) and len(killed) < 4:
            pids = list(client.run(os.getpid).values())
            for pid in pids[: 2 if killed else 1]:
                killed.append(pid)
                os.kill(pid, signal.SIGKILL)

    options = {"spp": 160, "size": (96, 96), "max_depth": 4}
    image = snell.distributed.render(foggy(), client, progress=kill, **options)
    assert len(killed) >= 3
    assert digest(image) == digest(snell.render(foggy(), **options))


@quiet
def test_a_cancelled_render_frees_the_workers_of_dask(client):
    def stop(share: float, rays: int) -> bool:
        return not any(client.processing().values())

    start = time.perf_counter()
    image = snell.distributed.render(
        "cornell-box", client, progress=stop, spp=1 << 20, size=(640, 480)
    )
    assert not image.metadata["is_complete"] and time.perf_counter() - start < 60
    for _ in range(200):
        if not any(client.processing().values()) and not any(client.call_stack().values()):
            break
        time.sleep(0.05)
    assert not any(client.call_stack().values())
    assert client.submit(sum, [1, 2]).result(timeout=30) == 3


@quiet
def test_an_error_on_a_worker_is_raised_here(cluster, monkeypatch):
    client = cluster.scheduler_address
    scene = snell.load("cornell-box")
    monkeypatch.setattr(_frames, "__version__", "0.1")
    with pytest.raises(RuntimeError, match=r"has Snell .*, and this program has 0\.1"):
        snell.distributed.render(scene, client, progress=False, **SMALL)


@quiet
def test_dask_starts_workers_of_its_own():
    pytest.importorskip("distributed", reason="Dask is not installed")
    image = snell.distributed.render("cornell-box", progress=False, **SMALL)
    assert digest(image) == digest(snell.render("cornell-box", **SMALL))


@quiet
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_control_c_ends_a_render_on_dask():
    pytest.importorskip("distributed", reason="Dask is not installed")
    code = """
        import os, signal, snell, snell.distributed
        if __name__ == "__main__":
            signal.signal(signal.SIGINT, signal.default_int_handler)
            def press(share, rays):
                if rays:
                    os.kill(os.getpid(), signal.SIGINT)
            try:
                snell.distributed.render("cornell-box", progress=press, spp=100000)
            except KeyboardInterrupt:
                print("interrupted")
    """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert run.stdout.strip() == "interrupted"


@pytest.fixture(scope="module")
def ray() -> Iterator[Any]:
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    yield ray
    ray.shutdown()


@quiet
@pytest.mark.parametrize("kind", ["path", "noise", "guiding", "layers"])
def test_ray_gives_the_same_bits(kind, ray, shuffled):
    options = {**SMALL, **KINDS[kind]}
    image = snell.distributed.render(foggy(), engine="ray", progress=False, **options)
    alone = snell.render(foggy(), **options)
    assert digest(image) == digest(alone) and facts(image) == facts(alone)


@quiet
def test_ray_loses_nothing_with_its_workers(ray, monkeypatch):
    monkeypatch.setattr(_frames, "_SAMPLES", 20_000)
    psutil = pytest.importorskip("psutil")
    killed: list[int] = []

    def kill(share: float, rays: int) -> None:
        if share > 0.2 * (len(killed) + 1) and len(killed) < 3:
            processes = psutil.Process().children(recursive=True)
            busy = [process for process in processes if "ray::_perform" in process.name()]
            for process in busy[:1]:
                killed.append(process.pid)
                process.kill()

    options = {"spp": 160, "size": (96, 96), "max_depth": 4}
    image = snell.distributed.render(foggy(), engine="ray", progress=kill, **options)
    assert killed and digest(image) == digest(snell.render(foggy(), **options))


@quiet
def test_ray_refuses_another_address(ray):
    with pytest.raises(ValueError, match="connected to a Ray cluster already"):
        snell.distributed.render("cornell-box", "ray://nowhere:10001", engine="ray", **SMALL)
