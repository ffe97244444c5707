// Handles that move and turn the selected thing or a light: arrows along the axes of the world,
// squares in its planes, rings about its axes.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import {
  apply,
  applyToVector,
  compose,
  IDENTITY,
  inverse,
  type Rows,
  translation,
  turnAbout,
} from "./affine";
import { type Camera, pixelAtPivot } from "./camera";
import type { Sight } from "./overlay";
import { alongLine, onPlane, rayThrough } from "./ray";
import { cornersOf, selection } from "./select";
import { rig, type Store, scene, size } from "./store";
import { type Pixel, tool, use } from "./tool";
import { isTouch } from "./touch";
import { add, cross, dot, mul, normalize, sub, type Vec3 } from "./vec";

/** Something that the handles move. */
export interface Target {
  /** Where the handles stand. */
  origin: Vec3;
  /** True if it makes a difference how it is turned. */
  turns: boolean;
  /** The changes of the scene that move it by a map of the world. */
  moved(by: Rows): [string, unknown][];
}

type Axis = 0 | 1 | 2;
type Handle = { kind: "axis" | "plane" | "ring"; axis: Axis };

const AXES: Vec3[] = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const ALL: Axis[] = [0, 1, 2];
const COLORS = ["#ff5a5a", "#5fd35f", "#5a9bff"];
/** Length of the arrows, radius of the rings, and place and side of the squares. */
const [ARROW, RING, SQUARE, SIDE] = [1, 0.8, 0.35, 0.2];
/**
 * Length of the arrows on the screen, and how near a mouse and a finger must come, in pixels of the
 * page.
 */
const [LENGTH, NEAR, NEAR_FINGER] = [84, 8, 14];
/** Points of a ring. */
const STEPS = 64;
/** Turning snaps to this angle. */
const SNAP = Math.PI / 12;

/** Names of the places and directions of lights in their declarations. */
export const PLACES = ["position", "center"];
const DIRECTIONS = ["direction", "normal"];

/** The selected node. */
export function selectedTarget(): Target | null {
  const place = selection.value?.place;
  if (!place) return null;
  const corners = cornersOf(place);
  const [world, own] = [place.world_from_parent as Rows, place.parent_from_node as Rows];
  const sum = corners.reduce(add, [0, 0, 0]);
  const middle: Vec3 =
    corners.length > 0 ? mul(sum, 1 / corners.length) : apply(compose(world, own), [0, 0, 0]);
  const back = inverse(world);
  if (!back) return null;
  const tidy = (rows: Rows): number[][] =>
    rows.map((row) => row.map((x) => Number(x.toPrecision(9))));
  return {
    origin: middle,
    turns: true,
    moved: (by) => [
      [`node.${place.node}.transform`, tidy(compose(back, compose(by, compose(world, own))))],
    ],
  };
}

/** A light of the scene; `null` for one without a place. */
export function lightTarget(index: number): Target | null {
  const light = scene.value?.lights[index];
  const place = light && PLACES.find((name) => name in light);
  if (!light || !place) return null;
  const origin = light[place] as Vec3;
  const tidy = (v: Vec3): number[] => v.map((x) => Number(x.toPrecision(7)));
  const directions = DIRECTIONS.filter((name) => name in light);
  const axes = light.axes as [Vec3, Vec3] | undefined;
  return {
    origin,
    turns: directions.length > 0 || axes !== undefined,
    moved: (by) => [
      [`light.${index}.${place}`, tidy(apply(by, origin))],
      ...directions.map((name): [string, unknown] => [
        `light.${index}.${name}`,
        tidy(applyToVector(by, light[name] as Vec3)),
      ]),
      ...(axes
        ? [
            [`light.${index}.axes`, axes.map((v) => tidy(applyToVector(by, v)))] as [
              string,
              unknown,
            ],
          ]
        : []),
    ],
  };
}

/** What the handles move now, by a name for the buttons that begin it; empty for nothing. */
export const carried = signal("");

interface Drag {
  handle: Handle;
  target: Target;
  camera: Camera;
  scale: number;
  from: Pixel;
  gesture: number;
}

const drag = signal<{ drag: Drag; by: Rows } | null>(null);
const hovered = signal<Handle | null>(null);
let find: () => Target | null = () => null;
let gestures = Math.floor(Math.random() * 1e6);

const isSame = (a: Handle | null, b: Handle): boolean => a?.kind === b.kind && a.axis === b.axis;

/** World units that the arrows are long, so that they look the same at any distance. */
function scaleAt(origin: Vec3): number {
  if (!rig.value) return 1;
  const ratio = size.value[0] / Math.max(1, document.querySelector(".stage")?.clientWidth ?? 1);
  return pixelAtPivot({ ...rig.value, pivot: origin }, size.value) * LENGTH * ratio;
}

/** The two other axes. */
const others = (axis: Axis): [Vec3, Vec3] => [AXES[(axis + 1) % 3]!, AXES[(axis + 2) % 3]!];

/** The lines of a handle in the world; of a ring only the half that faces the eye. */
function linesOf({ kind, axis }: Handle, origin: Vec3, scale: number, eye: Vec3): Vec3[] {
  const [a, b] = others(axis);
  const at = (u: number, v: number): Vec3 => add(origin, mul(add(mul(a, u), mul(b, v)), scale));
  if (kind === "axis") return [origin, add(origin, mul(AXES[axis]!, ARROW * scale))];
  if (kind === "plane")
    return [
      at(SQUARE, SQUARE),
      at(SQUARE + SIDE, SQUARE),
      at(SQUARE + SIDE, SQUARE + SIDE),
      at(SQUARE, SQUARE + SIDE),
      at(SQUARE, SQUARE),
    ];
  const view = normalize(sub(eye, origin));
  const points = Array.from({ length: STEPS + 1 }, (_, i) => {
    const angle = (i / STEPS) * 2 * Math.PI;
    return at(RING * Math.cos(angle), RING * Math.sin(angle));
  });
  const faces = (p: Vec3): boolean => dot(sub(p, origin), view) >= -0.05 * scale;
  // One piece: the hidden half comes last.
  const first = points.findIndex((p, i) => faces(p) && !faces(points[(i + STEPS - 1) % STEPS]!));
  if (first < 0) return points;
  const turned = Array.from({ length: STEPS }, (_, i) => points[(first + i) % STEPS]!);
  return turned.filter(faces);
}

const handlesOf = (target: Target): Handle[] => [
  ...(target.turns ? ALL.map((axis): Handle => ({ kind: "ring", axis })) : []),
  ...ALL.map((axis): Handle => ({ kind: "plane", axis })),
  ...ALL.map((axis): Handle => ({ kind: "axis", axis })),
];

/** Distance of a pixel from a line of pixels. */
function distance(p: Pixel, a: { x: number; y: number }, b: { x: number; y: number }): number {
  const [dx, dy] = [b.x - a.x, b.y - a.y];
  const t = ((p[0] - a.x) * dx + (p[1] - a.y) * dy) / (dx * dx + dy * dy || 1);
  const s = Math.max(0, Math.min(1, t));
  return Math.hypot(p[0] - a.x - s * dx, p[1] - a.y - s * dy);
}

/** The handle nearest to the pointer and within its reach; of equals the uppermost. */
function handleAt(
  at: Pixel,
  target: Target,
  place: Sight["place"],
  pointer: string,
): Handle | null {
  const scale = scaleAt(target.origin);
  const eye = rig.value!.camera.eye;
  const ratio = size.value[0] / (document.querySelector(".stage")?.clientWidth || 1);
  const away = (handle: Handle): number => {
    const lines = linesOf(handle, target.origin, scale, eye).map(place);
    const pairs = lines.slice(1).map((next, i) => [lines[i], next] as const);
    return Math.min(...pairs.map(([a, b]) => (a && b ? distance(at, a, b) : Infinity)));
  };
  const found = handlesOf(target)
    .reverse()
    .map((handle) => ({ handle, away: away(handle) }))
    .reduce((best, next) => (next.away < best.away ? next : best));
  const near = (pointer === "touch" ? NEAR_FINGER : NEAR) * ratio;
  return found.away <= near ? found.handle : null;
}

/** A step that reads well: 1, 2 or 5 of a power of ten. */
export function niceStep(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  const [five, two] = [5 * power, 2 * power];
  return five <= most ? five : two <= most ? two : power;
}

const snapped = (x: number, step: number): number => Math.round(x / step) * step;

/** The map of the world that a drag to a pixel stands for. */
export function movedBy(
  drag: Pick<Drag, "handle" | "camera" | "scale" | "from"> & { target: { origin: Vec3 } },
  to: Pixel,
  snaps: boolean,
  size: [number, number],
): Rows {
  const { handle, camera, target, scale } = drag;
  const axis = AXES[handle.axis]!;
  const rays = [drag.from, to].map((pixel) => rayThrough(camera, pixel, size));
  const [before, after] = rays;
  if (!before || !after) return IDENTITY;
  const step = niceStep(scale / 5);
  if (handle.kind === "axis") {
    const [a, b] = [before, after].map((ray) => alongLine(ray, target.origin, axis));
    if (a === null || b === null || a === undefined || b === undefined) return IDENTITY;
    return translation(mul(axis, snaps ? snapped(b - a, step) : b - a));
  }
  const [a, b] = [before, after].map((ray) => onPlane(ray, target.origin, axis));
  if (!a || !b) return IDENTITY;
  if (handle.kind === "plane") {
    const by = sub(b, a);
    return translation(snaps ? (by.map((x) => snapped(x, step)) as Vec3) : by);
  }
  const [u, v] = [a, b].map((point) => normalize(sub(point, target.origin)));
  const angle = Math.atan2(dot(cross(u!, v!), axis), dot(u!, v!));
  return turnAbout(target.origin, axis, snaps ? snapped(angle, SNAP) : angle);
}

/** Puts the handles on something, or takes them away if they are on it. */
export function carry(store: Store, name: string, target: () => Target | null): void {
  if (carried.value === name) {
    use(null);
    return;
  }
  find = target;
  let sent = 0;
  const send = (now: Drag, by: Rows): void => {
    drag.value = { drag: now, by };
    if (sent) return;
    sent = requestAnimationFrame(() => {
      sent = 0;
      const last = drag.value;
      if (last) store.edits(last.drag.target.moved(last.by), last.drag.gesture);
    });
  };
  const place: Sight["place"] = (point) => store.place(point);
  use({
    name: `Move ${name}`,
    hint: isTouch()
      ? "Drag an arrow, a square or a ring"
      : "Drag an arrow, a square or a ring; Ctrl: in steps; Escape: done",
    down: (at, event) => {
      const target = find();
      const handle = target && rig.value && handleAt(at, target, place, event.pointerType);
      if (!target || !handle) return false;
      gestures += 1;
      const camera = rig.value!.camera;
      const scale = scaleAt(target.origin);
      drag.value = {
        drag: { handle, target, camera, scale, from: at, gesture: gestures },
        by: IDENTITY,
      };
      return true;
    },
    move: (at, event) => {
      const now = drag.value;
      if (now) send(now.drag, movedBy(now.drag, at, event.ctrlKey || event.metaKey, size.value));
      else {
        const target = find();
        hovered.value = target && rig.value ? handleAt(at, target, place, event.pointerType) : null;
      }
    },
    up: () => {
      const last = drag.value;
      drag.value = null;
      if (last) store.edits(last.drag.target.moved(last.by), last.drag.gesture);
    },
    end: () => {
      carried.value = "";
      hovered.value = null;
      drag.value = null;
    },
  });
  carried.value = name;
}

/** The handles over the picture. */
export function Gizmo({ sight }: { sight: Sight }): JSX.Element | null {
  if (!carried.value || !tool.value) return null;
  const now = drag.value;
  const target = now?.drag.target ?? find();
  if (!target) return null;
  const origin = now ? apply(now.by, target.origin) : target.origin;
  const scale = scaleAt(origin);
  const active = now?.drag.handle ?? hovered.value;
  return (
    <g class="gizmo">
      {handlesOf(target).map((handle) => {
        const points = linesOf(handle, origin, scale, sight.camera.eye).map(sight.place);
        if (points.some((point) => point === null)) return null;
        const text = points.map((point) => `${point!.x},${point!.y}`).join(" ");
        const color = COLORS[handle.axis]!;
        const end = points.at(-1)!;
        return (
          <g
            class={isSame(active, handle) ? `${handle.kind} active` : handle.kind}
            data-axis={"xyz"[handle.axis]}
          >
            <polyline
              points={text}
              stroke={color}
              fill={handle.kind === "plane" ? color : "none"}
            />
            {handle.kind === "axis" && <circle cx={end.x} cy={end.y} r="6" fill={color} />}
          </g>
        );
      })}
    </g>
  );
}
