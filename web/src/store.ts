// The state of the page, as signals, and its actions.

import { computed, signal } from "@preact/signals";
import { type Camera, frameBall, move, preset, type Rig, rigOf } from "./camera";
import { Connection, type Frame } from "./connection";
import { Picture } from "./picture";
import type {
  Choices,
  PickedHit,
  Report,
  SceneInfo,
  ToPage,
  ToServer,
  ViewInfo,
} from "./protocol.gen";
import { add, length, mul, sub, type Vec3 } from "./vec";

export interface Notice {
  id: number;
  text: string;
}

export interface Numbers {
  samples: number;
  wanted: number;
  seconds: number;
  noise: number;
  /** Pixels of the last frame, and its share of the picture's width. */
  size: [number, number];
  scale: number;
  framesPerSecond: number;
  latency: number;
}

export const connected = signal(false);
export const choices = signal<Choices | null>(null);
export const scene = signal<SceneInfo | null>(null);
export const view = signal<ViewInfo | null>(null);
export const steering = signal<{ client: number; watching: number; me: number }>({
  client: 0,
  watching: 0,
  me: 0,
});
export const notices = signal<Notice[]>([]);
export const busy = signal("");
export const numbers = signal<Numbers>({
  samples: 0,
  wanted: 0,
  seconds: 0,
  noise: NaN,
  size: [0, 0],
  scale: 1,
  framesPerSecond: 0,
  latency: 0,
});
export const picked = signal<PickedHit | null>(null);
/** The pixel that was picked. */
export const pickedPixel = signal<[number, number] | null>(null);
/** The explanation that is shown. */
export const explained = signal<Report | null>(null);
/** True if the next click sets the focus. */
export const focusing = signal(false);
/** True if scenes are offered. */
export const gallery = signal(false);
/** True if acceleration structures are compared. */
export const costs = signal(false);
export const exposure = signal(0);
export const tonemap = signal("none");
export const comparing = signal(false);
export const steers = computed(
  () => steering.value.client === steering.value.me || steering.value.client === 0,
);

/** Frames are counted over this long. */
const RATE_WINDOW = 1000;
/** A picture has at most this many pixels, whatever the screen has. */
const MAX_PIXELS = 1920 * 1080;

export class Store {
  readonly picture = new Picture();
  rig: Rig | null = null;
  size: [number, number] = [1, 1];
  private readonly connection: Connection;
  private seq = 0;
  private sent = new Map<number, number>();
  private arrivals: number[] = [];
  private isDirty = false;
  private generation = -1;
  private wasWelcome = false;
  private noticeId = 0;
  private pickId = 0;
  private picks = new Map<number, (hit: PickedHit | null) => void>();
  private reports = new Map<number, () => void>();

  constructor(url: string) {
    this.connection = new Connection(url, {
      message: (message) => this.receive(message),
      frame: (frame) => this.show(frame),
      status: (open) => {
        connected.value = open;
        if (open) this.sendSize();
      },
    });
  }

  send(message: ToServer): void {
    this.connection.send(message);
  }

  /** Sends the camera with the next frame of the browser; later calls until then replace it. */
  setRig(rig: Rig): void {
    this.rig = rig;
    if (this.isDirty) return;
    this.isDirty = true;
    requestAnimationFrame(() => {
      this.isDirty = false;
      if (!this.rig) return;
      this.seq += 1;
      this.sent.set(this.seq, performance.now());
      this.send({ type: "camera", seq: this.seq, camera: this.rig.camera });
    });
  }

  setCamera(camera: Camera): void {
    if (this.rig) this.setRig({ ...this.rig, camera });
  }

  /** The canvas has another size, in pixels of the screen. */
  resize(width: number, height: number): void {
    const scale = Math.min(1, Math.sqrt(MAX_PIXELS / Math.max(1, width * height)));
    this.size = [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
    this.sendSize();
  }

  private sendSize(): void {
    if (this.size[0] > 1) this.send({ type: "size", size: this.size });
  }

  setDisplay(next: { exposure?: number; tonemap?: string }): void {
    exposure.value = next.exposure ?? exposure.value;
    tonemap.value = next.tonemap ?? tonemap.value;
    this.send({ type: "display", exposure: exposure.value, tonemap: tonemap.value });
    this.picture.display = {
      exposure: exposure.value,
      tonemap: tonemap.value,
      srgb: view.value?.srgb ?? true,
    };
    this.picture.redraw();
  }

  edit(key: string, value: unknown): void {
    this.send({ type: "edit", key, value });
  }

  pick(x: number, y: number): Promise<PickedHit | null> {
    const id = ++this.pickId;
    this.send({ type: "pick", id, pixel: [x, y] });
    return new Promise((resolve) => this.picks.set(id, resolve));
  }

  /** Explains a pixel. */
  explain(pixel: [number, number], sample: number | null = null, all = false): Promise<void> {
    const id = ++this.pickId;
    this.send({ type: "explain", id, pixel, sample, all });
    busy.value = "following the light";
    return new Promise((resolve) => this.reports.set(id, resolve));
  }

  /** Focuses on the point at a pixel, and turns about it from then on if that is wanted. */
  async focus(x: number, y: number, turns = true): Promise<void> {
    const hit = await this.pick(x, y);
    if (!hit || !this.rig) return;
    const { camera } = this.rig;
    const depth = sub(hit.position, camera.eye).reduce(
      (sum, v, i) => sum + v * camera.towards[i],
      0,
    );
    this.setRig({
      ...this.rig,
      pivot: turns ? hit.position : this.rig.pivot,
      camera: { ...camera, focus_distance: Math.max(depth, 1e-6) },
    });
  }

  private ball(): [Vec3, number] {
    const bounds = scene.value?.bounds ?? [
      [-1, -1, -1],
      [1, 1, 1],
    ];
    const [low, high] = bounds as [Vec3, Vec3];
    return [mul(add(low, high), 0.5), length(sub(high, low)) / 2];
  }

  frameAll(): void {
    if (this.rig) this.setRig(frameBall(this.rig, ...this.ball(), this.size));
  }

  look(direction: Vec3): void {
    if (this.rig) this.setRig(preset(this.rig, direction, ...this.ball(), this.size));
  }

  setUp(worldUp: Vec3): void {
    if (this.rig) this.setRig(move({ ...this.rig, worldUp }, 0, 0, 0));
  }

  useCamera(camera: Camera): void {
    const info = scene.value;
    if (!info) return;
    this.setRig(rigOf(camera, info.bounds as [Vec3, Vec3], this.rig?.worldUp ?? (info.up as Vec3)));
  }

  /** Speed of flying: a fraction of the scene's size per second. */
  get stride(): number {
    return this.ball()[1] * 0.5;
  }

  async open(query: string, body?: Blob): Promise<void> {
    const response = await fetch(`open?${query}`, { method: "POST", body: body ?? null });
    if (response.ok) {
      this.rig = null;
      gallery.value = false;
      explained.value = null;
      picked.value = null;
      this.adopt();
    } else this.notice((await response.text()).trim());
  }

  notice(text: string): void {
    const id = ++this.noticeId;
    notices.value = [...notices.value.slice(-3), { id, text }];
    window.setTimeout(() => (notices.value = notices.value.filter((n) => n.id !== id)), 8000);
  }

  private receive(message: ToPage): void {
    switch (message.type) {
      case "welcome":
        choices.value = message.choices;
        gallery.value = message.is_gallery && !this.wasWelcome;
        this.wasWelcome = true;
        steering.value = { ...steering.value, me: message.client };
        this.generation = -1;
        break;
      case "scene":
        if (scene.value?.name !== message.scene.name) this.rig = null;
        scene.value = message.scene;
        document.title = `${message.scene.name} – Snell`;
        this.adopt();
        break;
      case "view":
        view.value = message.view;
        exposure.value = message.view.exposure;
        tonemap.value = message.view.tonemap;
        this.picture.display = message.view;
        this.picture.pictureSize = message.view.size as [number, number];
        this.adopt();
        break;
      case "steering":
        steering.value = { ...steering.value, client: message.client, watching: message.watching };
        break;
      case "picked":
        this.picks.get(message.id)?.(message.hit);
        this.picks.delete(message.id);
        break;
      case "explained":
        busy.value = "";
        if (message.report) explained.value = message.report;
        this.reports.get(message.id)?.();
        this.reports.delete(message.id);
        break;
      case "error":
        this.notice(message.message);
        break;
      case "busy":
        busy.value = message.message;
        break;
    }
  }

  /** The server's camera, when the page has none of its own or does not steer. */
  private adopt(): void {
    const [info, now] = [scene.value, view.value];
    if (!info || !now) return;
    if (!this.rig || !steers.value) {
      this.rig = rigOf(
        now.camera,
        info.bounds as [Vec3, Vec3],
        this.rig?.worldUp ?? (info.up as Vec3),
      );
    }
  }

  private async show(frame: Frame): Promise<void> {
    await this.picture.show(frame);
    const now = performance.now();
    this.arrivals = [...this.arrivals.filter((t) => now - t < RATE_WINDOW), now];
    const start = this.sent.get(frame.seq);
    for (const seq of this.sent.keys()) if (seq <= frame.seq) this.sent.delete(seq);
    this.generation = Math.max(this.generation, frame.generation);
    // bench/viewer_speed.mjs creates this list to collect the times of frames.
    const list = (
      window as unknown as {
        snellFrames?: { latency: number; scale: number; milliseconds: number }[];
      }
    ).snellFrames;
    if (frame.wanted === 0) {
      const latency = start === undefined ? -1 : now - start;
      list?.push({
        latency,
        scale: frame.size[0] / this.size[0],
        milliseconds: frame.milliseconds,
      });
    }
    numbers.value = {
      samples: frame.samples,
      wanted: frame.wanted,
      seconds: frame.milliseconds / 1000,
      noise: frame.noise,
      size: frame.size,
      scale: frame.size[0] / this.size[0],
      framesPerSecond: this.arrivals.length,
      latency: start === undefined ? numbers.value.latency : now - start,
    };
  }
}
