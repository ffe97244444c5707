// The state of the page, as signals, and its actions.

import { computed, signal } from "@preact/signals";
import {
  type Box,
  type Camera,
  frameBox,
  move,
  type Projection,
  preset,
  project,
  type Rig,
  rigOf,
  type Scenery,
  toggleParallel,
  withCamera,
} from "./camera";
import { Connection, type Frame } from "./connection";
import { host } from "./host";
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
import { length, sub, type Vec3 } from "./vec";

export interface Notice {
  id: number;
  text: string;
}

export interface Numbers {
  samples: number;
  wanted: number;
  seconds: number;
  noise: number;
  /** Share of a denoised picture in what is shown. */
  denoised: number;
  /** Pixels of the last frame, and its share of the picture's width. */
  size: [number, number];
  scale: number;
  framesPerSecond: number;
  latency: number;
}

export const connected = signal(false);
/** True after tries enough to believe that the server has ended. */
export const gone = signal(false);
export const choices = signal<Choices | null>(null);
export const scene = signal<SceneInfo | null>(null);
export const view = signal<ViewInfo | null>(null);
export const steering = signal<{ client: number; watching: number; me: number }>({
  client: 0,
  watching: 0,
  me: 0,
});
export const notices = signal<Notice[]>([]);
/** How often the server has refused something. */
export const refusals = signal(0);
export const busy = signal("");
export const numbers = signal<Numbers>({
  samples: 0,
  wanted: 0,
  seconds: 0,
  noise: NaN,
  denoised: 0,
  size: [0, 0],
  scale: 1,
  framesPerSecond: 0,
  latency: 0,
});
export const picked = signal<PickedHit | null>(null);
/** The pixel that was picked. */
export const pickedPixel = signal<[number, number] | null>(null);
/** True while an explanation is waited for. */
export const explaining = signal(false);
/** The explanation that is shown. */
export const explained = signal<Report | null>(null);
/** True if the next click sets the focus. */
export const focusing = signal(false);
/** True if scenes are offered. */
export const gallery = signal(false);
/** True if acceleration structures are compared. */
export const costs = signal(false);
/** The camera that the page wants; the picture follows. */
export const rig = signal<Rig | null>(null);
/** Width and height of the picture in pixels. */
export const size = signal<[number, number]>([1, 1]);
export const exposure = signal(0);
export const tonemap = signal("none");
export const steers = computed(
  () => steering.value.client === steering.value.me || steering.value.client === 0,
);

/** Milliseconds without a connection after which the server is said to have ended. */
const GONE = 4000;
/** Milliseconds for which a notice stays. */
const NOTICE = 8000;
/** Moves of one kind within this many milliseconds are undone together. */
const SAME_GESTURE = 1000;
/** The answer to what is selected. */
type Found = Pick<Extract<ToPage, { type: "selected" }>, "place" | "mask" | "material">;

/** Frames are counted over this long. */
const RATE_WINDOW = 1000;
/** A picture has at most this many pixels, whatever the screen has. */
const MAX_PIXELS = 1920 * 1080;

export class Store {
  readonly picture = new Picture();

  get rig(): Rig | null {
    return rig.value;
  }

  set rig(next: Rig | null) {
    rig.value = next;
  }

  get size(): [number, number] {
    return size.value;
  }

  set size(next: [number, number]) {
    size.value = next;
  }

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
  private found = new Map<number, (found: Found) => void>();
  private reports = new Map<number, () => void>();
  /** Number of the gesture that moves the camera, its kind, and when it last did. */
  private gesture = { number: 0, kind: "", time: 0 };
  /** The count of `ViewInfo.camera_changes` up to which the page has taken the camera. */
  private cameraChanges = -1;
  /** The perspective that a parallel view returns to. */
  private perspective: Projection | undefined;
  private goneTimer = 0;
  /** When the user last chose how the picture is shown. */
  private displayTime = -Infinity;

  constructor() {
    this.connection = new Connection(() => host.connect(), {
      message: (message) => this.receive(message),
      frame: (frame) => this.show(frame),
      status: (open) => {
        connected.value = open;
        window.clearTimeout(this.goneTimer);
        if (open) {
          gone.value = false;
          this.sendSize();
        } else {
          busy.value = "";
          this.goneTimer = window.setTimeout(() => (gone.value = true), GONE);
        }
      },
    });
  }

  send(message: ToServer): void {
    this.connection.send(message);
  }

  /** True if this page may change something; if another one steers, says so. */
  maySteer(): boolean {
    if (!steers.value) this.notice("Another page steers: take over to change something");
    return steers.value;
  }

  /** Takes control of the view. */
  takeOver(): void {
    this.send({ type: "steer" });
    this.sendSize();
  }

  /**
   * What moves the camera from now on is undone in one step. A kind goes on with the last gesture
   * if that was of the same kind, a moment ago.
   */
  beginGesture(kind = ""): void {
    const now = performance.now();
    const isSame = kind !== "" && kind === this.gesture.kind;
    const goesOn = isSame && now - this.gesture.time < SAME_GESTURE;
    // Numbers of different pages differ.
    const fresh = (): number => Math.floor(Math.random() * 2 ** 32);
    // A move that is not sent yet belongs to the gesture before.
    if (!goesOn) this.flush();
    this.gesture = { number: goesOn ? this.gesture.number : fresh(), kind, time: now };
  }

  /** Sends the camera with the next frame of the browser; later calls until then replace it. */
  setRig(rig: Rig): void {
    if (!this.maySteer()) return;
    this.rig = rig;
    this.gesture.time = performance.now();
    if (this.isDirty) return;
    this.isDirty = true;
    requestAnimationFrame(() => this.flush());
  }

  /** Sends the camera if it has moved since it was last sent. */
  private flush(): void {
    if (!this.isDirty) return;
    this.isDirty = false;
    if (!this.rig) return;
    this.seq += 1;
    this.sent.set(this.seq, performance.now());
    const { camera } = this.rig;
    this.send({ type: "camera", seq: this.seq, camera, gesture: this.gesture.number });
  }

  setCamera(camera: Camera): void {
    this.beginGesture("camera");
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
    if (!this.maySteer()) return;
    this.displayTime = performance.now();
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

  /** Several changes of the scene that are one step of the history. */
  edits(edits: [string, unknown][], gesture: number | null = null): void {
    this.send({ type: "edits", edits, gesture });
  }

  /** Where something stands, which pixels show it, and the material of one of its surfaces. */
  select(path: number[], width: number, surface: [number, number] | null = null): Promise<Found> {
    const id = ++this.pickId;
    this.send({ type: "select", id, path, width, surface });
    return new Promise((resolve) => this.found.set(id, resolve));
  }

  /** The pixel that shows a point of the world. */
  place(point: Vec3): { x: number; y: number; depth: number } | null {
    return this.rig && project(this.rig.camera, point, this.size);
  }

  /** What is at a pixel, or else next to it within `reach` pixels. */
  pick(x: number, y: number, reach = 0): Promise<PickedHit | null> {
    const id = ++this.pickId;
    // The server answers for the camera that it knows.
    this.flush();
    this.send({ type: "pick", id, pixel: [x, y], reach });
    return new Promise((resolve) => this.picks.set(id, resolve));
  }

  /** Explains a pixel. */
  explain(pixel: [number, number], sample: number | null = null, all = false): Promise<void> {
    const id = ++this.pickId;
    this.send({ type: "explain", id, pixel, sample, all });
    busy.value = "following the light";
    explaining.value = true;
    return new Promise((resolve) => this.reports.set(id, resolve));
  }

  /** Does not wait for explanations any longer. */
  stopExplaining(): void {
    if (explaining.value) busy.value = "";
    explaining.value = false;
    for (const answered of this.reports.values()) answered();
    this.reports.clear();
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
    this.beginGesture();
    this.setRig({
      ...this.rig,
      pivot: turns ? hit.position : this.rig.pivot,
      camera: { ...camera, focus_distance: Math.max(depth, 1e-6) },
    });
  }

  private boxes(): { subject: Box; bounds: Box } {
    const unit: Box = [
      [-1, -1, -1],
      [1, 1, 1],
    ];
    const { subject = unit, bounds = unit } = scene.value ?? {};
    return { subject: subject as Box, bounds: bounds as Box };
  }

  private see(box: Box): void {
    this.beginGesture();
    if (this.rig) this.setRig(frameBox(this.rig, box, this.size));
  }

  /** Sees what is selected, or the subject of the scene. */
  frame(): void {
    this.see((picked.value?.bounds as Box | null | undefined) ?? this.boxes().subject);
  }

  /** Sees everything finite, also the ground. */
  frameAll(): void {
    this.see(this.boxes().bounds);
  }

  /** Sees the subject along an axis. */
  look(direction: Vec3): void {
    this.beginGesture();
    const { subject } = this.boxes();
    if (this.rig) this.setRig(preset(this.rig, direction, subject, this.size));
  }

  /** Back to the camera of the first picture. */
  home(): void {
    this.useCamera(null);
  }

  /** The view of one of the scene's cameras, by its number. */
  useCamera(number: number | null): void {
    if (!this.maySteer()) return;
    this.beginGesture();
    this.flush();
    this.send({ type: "home", camera: number, gesture: this.gesture.number });
  }

  /** Parallels instead of perspective, or the other way round. */
  toggleParallel(): void {
    if (!this.rig) return;
    const { projection } = this.rig.camera;
    const before = this.perspective;
    if (projection.projection === "perspective") this.perspective = projection;
    this.beginGesture();
    this.setRig(toggleParallel(this.rig, this.size, before));
  }

  setUp(worldUp: Vec3): void {
    this.beginGesture();
    if (this.rig) this.setRig(move({ ...this.rig, worldUp, ground: null }, 0, 0, 0));
  }

  /** Speed of flying: a fraction of the subject's size per second. */
  get stride(): number {
    const [low, high] = this.boxes().subject;
    return length(sub(high, low)) * 0.25;
  }

  undo(): void {
    if (!this.maySteer()) return;
    this.flush();
    this.send({ type: "undo" });
  }

  redo(): void {
    if (!this.maySteer()) return;
    this.flush();
    this.send({ type: "redo" });
  }

  /** Opens a scene; false if it cannot be opened, which is said. */
  async open(query: string, body?: Blob): Promise<boolean> {
    if (!this.maySteer()) return false;
    const most = choices.value?.max_upload ?? Infinity;
    if (body && body.size > most) {
      const [size, limit] = [body.size, most].map((n) => Math.ceil(n / 2 ** 20));
      const name = new URLSearchParams(query).get("name") ?? "the file";
      this.notice(
        `${name} has ${size} MB, and a page sends at most ${limit} MB: ` +
          "open it by its name, `snell view FILE`",
      );
      return false;
    }
    const asked = `open?${query}&client=${steering.value.me}`;
    const response = await this.ask(asked, { method: "POST", body: body ?? null });
    if (!response) return false;
    if (!response.ok) {
      this.notice((await response.text()).trim());
      return false;
    }
    this.rig = null;
    gallery.value = false;
    explained.value = null;
    picked.value = null;
    this.adopt();
    return true;
  }

  /**
   * Resolves when the server has done all that the page has asked for: it answers messages in their
   * order, and a request by another way may overtake them.
   */
  async heard(): Promise<void> {
    if (!connected.value) return;
    const limit = new Promise((resolve) => window.setTimeout(resolve, 5000));
    await Promise.race([this.pick(0, 0), limit]);
  }

  /** True until the picture at rest is shown that the page has asked for. */
  get isMoving(): boolean {
    const isKnown = numbers.value.wanted > 0 && this.picture.linear !== null;
    return !isKnown || this.isDirty || this.sent.size > 0;
  }

  /** Resolves when the picture rests, or when it has not for long. */
  async rested(): Promise<void> {
    await this.heard();
    for (let i = 0; i < 100; i++) {
      await new Promise((resolve) => window.setTimeout(resolve, 50));
      if (numbers.value.wanted > 0 && this.sent.size === 0) return;
    }
  }

  /** The answer of the server; `null` if there is none, which is said. */
  async ask(address: string, options?: RequestInit): Promise<Response | null> {
    try {
      return await host.ask(address, options);
    } catch {
      this.notice(host.silent);
      return null;
    }
  }

  notice(text: string): void {
    // A drag would say the same again and again.
    if (notices.value[0]?.text === text) return;
    const id = ++this.noticeId;
    // The newest one takes the place of the last.
    notices.value = [{ id, text }];
    window.setTimeout(() => (notices.value = notices.value.filter((n) => n.id !== id)), NOTICE);
  }

  private receive(message: ToPage): void {
    switch (message.type) {
      case "welcome":
        choices.value = message.choices;
        gallery.value = message.is_gallery && !this.wasWelcome;
        this.wasWelcome = true;
        steering.value = { ...steering.value, me: message.client };
        this.generation = -1;
        this.cameraChanges = -1;
        break;
      case "scene":
        if (scene.value?.name !== message.scene.name) {
          this.rig = null;
          picked.value = null;
          explained.value = null;
        }
        scene.value = message.scene;
        document.title = `${message.scene.name} – Snell`;
        if (this.rig) this.rig = { ...this.rig, ground: this.scenery()?.ground ?? null };
        this.adopt();
        break;
      case "view":
        view.value = message.view;
        this.takeDisplay(message.view);
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
      case "selected":
        this.found.get(message.id)?.(message);
        this.found.delete(message.id);
        break;
      case "explained":
        // One that is not waited for any longer is not shown.
        if (!this.reports.has(message.id)) break;
        if (message.report) explained.value = message.report;
        this.reports.get(message.id)?.();
        this.reports.delete(message.id);
        if (this.reports.size === 0) this.stopExplaining();
        break;
      case "error":
        refusals.value++;
        this.notice(message.message);
        break;
      case "notice":
        this.notice(message.message);
        break;
      case "busy":
        busy.value = message.message;
        break;
    }
  }

  /** Shows pictures as the server says, unless the user is just choosing. */
  private takeDisplay({ exposure: stops, tonemap: name, srgb }: ViewInfo): void {
    const isChoosing = steers.value && performance.now() - this.displayTime < SAME_GESTURE;
    if (!isChoosing) [exposure.value, tonemap.value] = [stops, name];
    const display = { exposure: exposure.value, tonemap: tonemap.value, srgb };
    const before = this.picture.display;
    this.picture.display = display;
    if (JSON.stringify(before) !== JSON.stringify(display)) this.picture.redraw();
  }

  private scenery(): Scenery | null {
    const info = scene.value;
    if (!info) return null;
    const up = this.rig?.worldUp ?? (info.up as Vec3);
    const isLevel = length(sub(up, info.up as Vec3)) < 1e-6;
    return { subject: this.boxes().subject, up, ground: isLevel ? info.ground : null };
  }

  /**
   * The server's camera, when the page has none of its own, does not steer, or when the server has
   * put the camera somewhere else.
   */
  private adopt(): void {
    const [around, now] = [this.scenery(), view.value];
    if (!around || !now) return;
    const isElsewhere = now.camera_changes !== this.cameraChanges;
    if (this.rig && steers.value && !isElsewhere) return;
    this.cameraChanges = now.camera_changes;
    this.rig = this.rig ? withCamera(this.rig, now.camera) : rigOf(now.camera, around);
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
      denoised: frame.denoised,
      size: frame.size,
      scale: frame.size[0] / this.size[0],
      framesPerSecond: this.arrivals.length,
      latency: start === undefined ? numbers.value.latency : now - start,
    };
  }
}
