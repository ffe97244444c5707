// Mouse, touch and keyboard on the picture.

import { dolly, look, move, orbit, pixelAtPivot } from "./camera";
import type { Store } from "./store";
import type { Vec3 } from "./vec";

/** Radians per pixel of the screen. */
const TURN = 0.006;
/** Factor on the distance for one step of the wheel. */
const WHEEL = 0.0012;

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
  /** Where the pointer is. */
  let at: { clientX: number; clientY: number } | null = null;

  /** Pixels of the picture per pixel of the page. */
  const ratio = (): number => store.size[0] / Math.max(1, element.clientWidth);
  const inPicture = (event: { clientX: number; clientY: number }): [number, number] => {
    const box = element.getBoundingClientRect();
    return [(event.clientX - box.left) * ratio(), (event.clientY - box.top) * ratio()];
  };
  const pan = (dx: number, dy: number): void => {
    if (!store.rig) return;
    const unit = pixelAtPivot(store.rig, store.size) * ratio();
    store.setRig(move(store.rig, -dx * unit, dy * unit, 0));
  };
  const zoom = (factor: number): void => {
    if (store.rig) store.setRig(dolly(store.rig, Math.max(0.1, Math.min(10, factor))));
  };

  const down = (event: PointerEvent): void => {
    element.setPointerCapture(event.pointerId);
    element.focus({ preventScroll: true });
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    moved = 0;
    mode =
      event.button === 1 || event.button === 2 || event.shiftKey
        ? "pan"
        : event.altKey
          ? "look"
          : "orbit";
  };
  const moveTo = (event: PointerEvent): void => {
    at = { clientX: event.clientX, clientY: event.clientY };
    const before = pointers.get(event.pointerId);
    if (!before || !store.rig) return;
    const now = { x: event.clientX, y: event.clientY };
    const [dx, dy] = [now.x - before.x, now.y - before.y];
    moved += Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)![1];
      const distance = (p: Point): number => Math.hypot(p.x - other.x, p.y - other.y);
      pan(dx / 2, dy / 2);
      zoom(distance(before) / Math.max(1, distance(now)));
    } else if (mode === "pan") pan(dx, dy);
    else if (mode === "look" || held.size > 0)
      store.setRig(look(store.rig, -dx * TURN * 0.5, dy * TURN * 0.5));
    else store.setRig(orbit(store.rig, dx * TURN, -dy * TURN));
    pointers.set(event.pointerId, now);
  };
  const up = (event: PointerEvent): void => {
    if (pointers.delete(event.pointerId) && moved < 4 && event.button === 0)
      actions.select(...inPicture(event));
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
    zoom(Math.exp(event.deltaY * lines * WHEEL));
  };
  const double = (event: MouseEvent): void => void store.focus(...inPicture(event));

  const fly = (last: number): void => {
    flying = requestAnimationFrame((now) => {
      if (held.size === 0 || !store.rig) {
        flying = 0;
        return;
      }
      const step = store.stride * Math.min(0.1, (now - last) / 1000);
      const sum = [...held]
        .map((code) => FLY[code])
        .reduce((a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
      store.setRig(move(store.rig, sum[0] * step, sum[1] * step, sum[2] * step));
      fly(now);
    });
  };

  const key = (event: KeyboardEvent): void => {
    const target = event.target as HTMLElement;
    if (/^(INPUT|SELECT|TEXTAREA)$/.test(target.tagName)) return;
    if (event.ctrlKey || event.metaKey) {
      if (event.code === "KeyZ") {
        event.preventDefault();
        if (event.shiftKey) actions.redo();
        else actions.undo();
      } else if (event.code === "KeyY") {
        event.preventDefault();
        actions.redo();
      }
      return;
    }
    if (FLY[event.code]) {
      held.add(event.code);
      if (!flying) fly(performance.now());
      return;
    }
    const preset = PRESETS.find((p) => p.key === event.key);
    if (preset) store.look(presetDirection(preset.direction, store.rig?.worldUp ?? [0, 1, 0]));
    else if (event.key === "f") store.frameAll();
    else if (event.key === "?") actions.help();
    else if (event.key === "p") actions.panel();
    else if (event.key === "c") actions.compare();
    else if (event.key === "x" && at) actions.explain(...inPicture(at));
    else if (event.key.startsWith("Arrow") && store.rig) {
      const [x, y] = {
        ArrowLeft: [-1, 0],
        ArrowRight: [1, 0],
        ArrowUp: [0, 1],
        ArrowDown: [0, -1],
      }[event.key]!;
      event.preventDefault();
      store.setRig(orbit(store.rig, x * 0.08, y * 0.08));
    } else if (event.key === "+" || event.key === "=") zoom(0.9);
    else if (event.key === "-") zoom(1.1);
  };
  const release = (event: KeyboardEvent): void => void held.delete(event.code);
  const blur = (): void => held.clear();
  const menu = (event: Event): void => event.preventDefault();

  const onElement: [string, EventListener][] = [
    ["pointerdown", down as EventListener],
    ["pointermove", moveTo as EventListener],
    ["pointerup", up as EventListener],
    ["pointercancel", up as EventListener],
    ["dblclick", double as EventListener],
    ["contextmenu", menu],
  ];
  for (const [name, f] of onElement) element.addEventListener(name, f);
  element.addEventListener("wheel", wheel, { passive: false });
  window.addEventListener("keydown", key);
  window.addEventListener("keyup", release);
  window.addEventListener("blur", blur);
  return () => {
    for (const [name, f] of onElement) element.removeEventListener(name, f);
    element.removeEventListener("wheel", wheel);
    window.removeEventListener("keydown", key);
    window.removeEventListener("keyup", release);
    window.removeEventListener("blur", blur);
  };
}
