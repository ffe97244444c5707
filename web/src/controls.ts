// Mouse, touch and keyboard on the picture.

import {
  aboveGround,
  depthOf,
  dolly,
  look,
  move,
  orbitAboveGround,
  pan,
  pointAt,
  type Rig,
} from "./camera";
import { isCovered } from "./dismiss";
import { isTyping } from "./keys";
import type { Store } from "./store";
import { type Pixel, tool, use } from "./tool";
import type { Vec3 } from "./vec";

/** Radians per pixel of the screen. */
const TURN = 0.006;
/** Factor on the distance for one step of the wheel. */
const WHEEL = 0.0012;
/** Milliseconds after which the wheel looks again for what is under the pointer. */
const WHEEL_PAUSE = 600;

export const PRESETS: { key: string; name: string; direction: Vec3 }[] = [
  { key: "1", name: "Front", direction: [0, 0, -1] },
  { key: "2", name: "Back", direction: [0, 0, 1] },
  { key: "3", name: "Right", direction: [-1, 0, 0] },
  { key: "4", name: "Left", direction: [1, 0, 0] },
  { key: "5", name: "Top", direction: [0, -1, 0] },
  { key: "6", name: "Bottom", direction: [0, 1, 0] },
];

/** The presets' directions are for `y` up; with `z` up, front looks along `y`. */
export function presetDirection(direction: Vec3, up: Vec3): Vec3 {
  return Math.abs(up[2]) > 0.5 ? [direction[0], -direction[2], direction[1]] : direction;
}

const FLY: Record<string, Vec3> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

interface Point {
  x: number;
  y: number;
}

export interface Actions {
  help(): void;
  panel(): void;
  compare(): void;
  /** Removes what is chosen and can be removed. */
  remove(): void;
  undo(): void;
  redo(): void;
  select(x: number, y: number): void;
  explain(x: number, y: number): void;
}

/** Listens until the returned function is called. */
export function listen(element: HTMLElement, store: Store, actions: Actions): () => void {
  const pointers = new Map<number, Point>();
  const held = new Set<string>();
  let moved = 0;
  let mode = "orbit";
  let flying = 0;
  let isFast = false;
  /** Where the pointer is. */
  let at: { clientX: number; clientY: number } | null = null;
  /** What the hand holds: where it took hold, of which view, and how far away that is. */
  let grip: { rig: Rig; from: Pixel; spread: number; depth?: number; point?: Vec3 } | null = null;
  /** The point that the wheel comes closer to, and where the pointer was when it was found. */
  let aim: { at: Pixel; time: number; point?: Vec3 } | null = null;

  /** Pixels of the picture per pixel of the page. */
  const ratio = (): number => store.size[0] / Math.max(1, element.clientWidth);
  const inPicture = (event: { clientX: number; clientY: number }): Pixel => {
    const box = element.getBoundingClientRect();
    return [(event.clientX - box.left) * ratio(), (event.clientY - box.top) * ratio()];
  };
  /** A motion that does not end below the ground. */
  const go = (before: Rig, after: Rig): void => store.setRig(aboveGround(before, after));

  /** The middle of all pointers, and their distance from it. */
  const hand = (): { middle: Pixel; spread: number } => {
    const points = [...pointers.values()].map(({ x, y }) => inPicture({ clientX: x, clientY: y }));
    const middle = [0, 1].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
    const distances = points.map((p) => Math.hypot(p[0] - middle[0], p[1] - middle[1]));
    return { middle: middle as Pixel, spread: Math.max(...distances) };
  };
  /** Takes hold of what is under the hand: the pivot's depth, until the server knows the point. */
  const hold = (): void => {
    if (!store.rig || pointers.size === 0) return;
    const { middle, spread } = hand();
    const taken: NonNullable<typeof grip> = { rig: store.rig, from: middle, spread };
    grip = taken;
    void store.pick(...middle).then((hit) => {
      if (!hit) return;
      taken.point = hit.position;
      const depth = depthOf(taken.rig.camera, hit.position);
      if (depth > 0) taken.depth = depth;
    });
  };
  const drag = (): void => {
    if (!grip) return;
    const { middle, spread } = hand();
    const { rig, from, depth } = grip;
    let next = pan(rig, from, middle, store.size, depth);
    if (pointers.size > 1 && grip.spread > 0 && spread > 0) {
      const under = pointAt(next, middle, store.size, depth);
      next = dolly(next, Math.max(0.02, Math.min(50, grip.spread / spread)), under);
    }
    go(rig, next);
  };
  const zoom = (factor: number, to?: Vec3): void => {
    const { rig } = store;
    if (rig) go(rig, dolly(rig, Math.max(0.1, Math.min(10, factor)), to));
  };

  const down = (event: PointerEvent): void => {
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (pointers.size === 1) {
      moved = 0;
      store.beginGesture();
      mode = tool.value?.down?.(inPicture(event), event)
        ? "tool"
        : event.button === 1 || event.button === 2 || event.shiftKey
          ? "pan"
          : event.altKey
            ? "look"
            : "orbit";
    }
    if (mode === "pan" || (mode !== "tool" && pointers.size > 1)) hold();
  };
  const moveTo = (event: PointerEvent): void => {
    at = { clientX: event.clientX, clientY: event.clientY };
    const before = pointers.get(event.pointerId);
    if (!before || mode === "tool") tool.value?.move?.(inPicture(event), event);
    if (!before || mode === "tool" || !store.rig) return;
    const now = { x: event.clientX, y: event.clientY };
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    moved += Math.abs(dx) + Math.abs(dy);
    pointers.set(event.pointerId, now);
    if (pointers.size > 1 || mode === "pan") drag();
    else if (mode === "look" || held.size > 0)
      store.setRig(look(store.rig, dx * TURN * 0.5, dy * TURN * 0.5));
    else store.setRig(orbitAboveGround(store.rig, dx * TURN, dy * TURN));
  };
  const up = (event: PointerEvent): void => {
    if (!pointers.delete(event.pointerId)) return;
    grip = null;
    if (mode === "tool") tool.value?.up?.(inPicture(event), event);
    else if (pointers.size > 0 || event.type === "pointercancel") moved += 4;
    else if (moved < 4 && event.button === 0) {
      if (tool.value?.click) tool.value.click(inPicture(event), event);
      else actions.select(...inPicture(event));
    }
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    if (!store.rig) return;
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
    const factor = Math.exp(event.deltaY * lines * WHEEL);
    const [now, pixel] = [performance.now(), inPicture(event)];
    const isSame = aim && Math.hypot(pixel[0] - aim.at[0], pixel[1] - aim.at[1]) < 3;
    if (!aim || !isSame || now - aim.time > WHEEL_PAUSE) {
      const found: NonNullable<typeof aim> = { at: pixel, time: now };
      aim = found;
      void store.pick(...pixel).then((hit) => {
        if (hit) found.point = hit.position;
      });
    }
    aim.time = now;
    store.beginGesture("wheel");
    zoom(factor, aim.point ?? pointAt(store.rig, pixel, store.size));
  };
  const double = (event: MouseEvent): void => {
    // Two quick clicks of a tool are two clicks.
    if (!tool.value) void store.focus(...inPicture(event));
  };

  const fly = (last: number): void => {
    flying = requestAnimationFrame((now) => {
      if (held.size === 0 || !store.rig) {
        flying = 0;
        return;
      }
      const step = store.stride * (isFast ? 4 : 1) * Math.min(0.1, (now - last) / 1000);
      const sum = [...held]
        .map((code) => FLY[code])
        .reduce((a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
      store.setRig(move(store.rig, sum[0] * step, sum[1] * step, sum[2] * step));
      fly(now);
    });
  };

  /** What single keys do. */
  const KEYS: Record<string, () => void> = {
    f: () => store.frame(),
    F: () => store.frameAll(),
    Home: () => store.frameAll(),
    0: () => store.home(),
    o: () => store.toggleParallel(),
    "?": () => actions.help(),
    p: () => actions.panel(),
    c: () => actions.compare(),
    Delete: () => actions.remove(),
    Backspace: () => actions.remove(),
    x: () => at && actions.explain(...inPicture(at)),
    "+": () => zoom(0.9),
    "=": () => zoom(0.9),
    "-": () => zoom(1.1),
    ArrowLeft: () => turn(-1, 0),
    ArrowRight: () => turn(1, 0),
    ArrowUp: () => turn(0, 1),
    ArrowDown: () => turn(0, -1),
  };
  const turn = (x: number, y: number): void => {
    store.beginGesture("arrows");
    if (store.rig) store.setRig(orbitAboveGround(store.rig, x * 0.08, y * 0.08));
  };
  const key = (event: KeyboardEvent): void => {
    isFast = event.shiftKey;
    if (event.defaultPrevented || isTyping(event)) return;
    if (isCovered()) return;
    if (event.ctrlKey || event.metaKey) {
      const redoes = event.code === "KeyY" || (event.code === "KeyZ" && event.shiftKey);
      if (!redoes && event.code !== "KeyZ") return;
      event.preventDefault();
      if (redoes) actions.redo();
      else actions.undo();
      return;
    }
    if (event.altKey) return;
    if (FLY[event.code]) {
      if (held.size === 0) store.beginGesture("fly");
      held.add(event.code);
      if (!flying) fly(performance.now());
      return;
    }
    const preset = PRESETS.find((p) => p.key === event.key);
    if (preset) store.look(presetDirection(preset.direction, store.rig?.worldUp ?? [0, 1, 0]));
    else if (event.key === "Escape") use(null);
    else if (KEYS[event.key]) {
      if (/^(Arrow|Home)/.test(event.key)) event.preventDefault();
      if (/^[-+=]$/.test(event.key)) store.beginGesture("wheel");
      KEYS[event.key]();
    }
  };
  const release = (event: KeyboardEvent): void => {
    isFast = event.shiftKey;
    held.delete(event.code);
  };
  const blur = (): void => held.clear();
  const menu = (event: Event): void => event.preventDefault();
  // A list that was chosen from with the pointer gives the keys back.
  let isPointed = false;
  const pointed = (): void => {
    isPointed = true;
  };
  const typed = (): void => {
    isPointed = false;
  };
  const chosen = (event: Event): void => {
    if (isPointed && event.target instanceof HTMLSelectElement) event.target.blur();
  };

  const onElement: [string, EventListener][] = [
    ["pointerdown", down as EventListener],
    ["pointermove", moveTo as EventListener],
    ["pointerup", up as EventListener],
    ["pointercancel", up as EventListener],
    ["dblclick", double as EventListener],
    ["contextmenu", menu],
  ];
  const onWindow: [string, EventListener][] = [
    ["keydown", typed],
    ["keydown", key as EventListener],
    ["keyup", release as EventListener],
    ["blur", blur],
    ["pointerdown", pointed],
    ["change", chosen],
  ];
  for (const [name, f] of onElement) element.addEventListener(name, f);
  for (const [name, f] of onWindow) window.addEventListener(name, f);
  element.addEventListener("wheel", wheel, { passive: false });
  return () => {
    for (const [name, f] of onElement) element.removeEventListener(name, f);
    for (const [name, f] of onWindow) window.removeEventListener(name, f);
    element.removeEventListener("wheel", wheel);
  };
}
