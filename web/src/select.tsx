// What is selected: its place, its outline, and what of the scene is shown with it.

import { computed, effect, signal } from "@preact/signals";
import type { JSX } from "preact";
import { apply, applyToVector, compose, inverse, type Rows } from "./affine";
import type { Sight } from "./overlay";
import type { Mask, PickedHit, Placement } from "./protocol.gen";
import { numbers, picked, type Store, scene, size } from "./store";
import { normalize, type Vec3 } from "./vec";

export interface Selection {
  /** Numbers of the nodes from the root to the selected one. */
  path: number[];
  place: Placement | null;
  /** The pixels that show it, in the picture at rest. */
  outline: string | null;
}

export const selection = signal<Selection | null>(null);

/** Width of the outline in pixels of the mask. */
const RADIUS = 2;
/** The colour of outlines: seen on dark and on light. */
const COLOR = [255, 160, 40];

/** Pixels just outside of a mask, the more opaque the nearer. */
export function ring(mask: Mask): Uint8ClampedArray {
  const [width, height] = mask.size;
  const inside = new Uint8Array(width * height);
  let at = 0;
  mask.runs.forEach((run, i) => {
    if (i % 2 === 1) inside.fill(1, at, at + run);
    at += run;
  });
  const alpha = new Uint8ClampedArray(width * height);
  for (let i = 0; i < inside.length; i++) {
    if (inside[i] === 0) continue;
    const [x, y] = [i % width, Math.floor(i / width)];
    const isEdge =
      x === 0 ||
      y === 0 ||
      x === width - 1 ||
      y === height - 1 ||
      !(inside[i - 1] && inside[i + 1] && inside[i - width] && inside[i + width]);
    if (!isEdge) continue;
    for (let dy = -RADIUS; dy <= RADIUS; dy++) {
      for (let dx = -RADIUS; dx <= RADIUS; dx++) {
        const [u, v] = [x + dx, y + dy];
        if (u < 0 || v < 0 || u >= width || v >= height) continue;
        const j = v * width + u;
        if (inside[j]) continue;
        const shade = 255 * (RADIUS + 0.5 - Math.hypot(dx, dy));
        alpha[j] = Math.max(alpha[j]!, shade);
      }
    }
  }
  return alpha;
}

/** The outline of a mask as the address of a picture. */
function drawn(mask: Mask): string {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = mask.size;
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(canvas.width, canvas.height);
  ring(mask).forEach((alpha, i) => {
    if (alpha > 0) image.data.set([...COLOR, alpha], 4 * i);
  });
  context.putImageData(image, 0, 0);
  return canvas.toDataURL();
}

/** Selects the thing at a path of nodes, or nothing. */
export function select(path: number[] | null): void {
  const known = selection.value;
  if (path === null || path.length === 0) selection.value = null;
  else if (known?.path.join() !== path.join())
    selection.value = { path, place: null, outline: null };
}

/** What was picked, after a change of the scene that may have moved it or changed its material. */
export function followed(
  hit: PickedHit,
  before: Placement | null,
  place: Placement,
  material: number | null,
): PickedHit {
  // What is hidden has no surfaces, and keeps its material.
  const name = material === null ? "" : String(scene.value?.materials[material]?.name ?? "");
  const next = place.bounds ? { ...hit, material, material_name: name } : hit;
  const world = (at: Placement): Rows =>
    compose(at.world_from_parent as Rows, at.parent_from_node as Rows);
  const back = before && inverse(world(before));
  if (!back || JSON.stringify(world(before)) === JSON.stringify(world(place))) return next;
  const by = compose(world(place), back);
  const corners = hit.bounds && boxCorners(hit.bounds as [Vec3, Vec3]).map((c) => apply(by, c));
  const end = (least: boolean): Vec3 =>
    [0, 1, 2].map((axis) =>
      (least ? Math.min : Math.max)(...corners!.map((corner) => corner[axis]!)),
    ) as Vec3;
  return {
    ...next,
    position: apply(by, hit.position as Vec3),
    normal: normalize(applyToVector(by, hit.normal as Vec3)),
    bounds: corners && [end(true), end(false)],
  };
}

/** Follows what is picked, the scene and the picture, until the returned function is called. */
export function followSelection(store: Store): () => void {
  let asked = 0;
  const ask = async (width: number): Promise<void> => {
    const { path, place: before } = selection.peek()!;
    const turn = ++asked;
    const hit = picked.peek();
    const isPicked = hit !== null && hit.nodes.join() === path.join();
    const surface = isPicked ? ([hit.surface, hit.primitive] as [number, number]) : null;
    const { place, mask, material } = await store.select(path, width, surface);
    if (turn !== asked || selection.peek()?.path !== path) return;
    selection.value = place ? { path, place, outline: mask && drawn(mask) } : null;
    if (!isPicked || picked.peek() !== hit) return;
    const now = place && followed(hit, before, place, material);
    if (JSON.stringify(now) !== JSON.stringify(hit)) picked.value = now;
  };
  const path = computed(() => selection.value?.path);
  const stops = [
    effect(() => {
      select(picked.value?.nodes ?? null);
    }),
    effect(() => {
      // Places change with the scene, outlines with the picture as well.
      const generation = scene.value?.generation;
      const isResting = numbers.value.wanted > 0;
      const [width] = size.value;
      if (path.value && generation !== undefined) void ask(isResting ? width : 0);
    }),
  ];
  return () => {
    for (const stop of stops) stop();
  };
}

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7];
const EDGES = CORNERS.flatMap((a) =>
  [1, 2, 4].filter((bit) => !(a & bit)).map((bit) => [a, a | bit]),
);

const boxCorners = ([low, high]: [Vec3, Vec3]): Vec3[] =>
  CORNERS.map((i) => [
    i & 1 ? high[0] : low[0],
    i & 2 ? high[1] : low[1],
    i & 4 ? high[2] : low[2],
  ]);

/** The corners of a placement's box in the world. */
export function cornersOf(place: Placement): Vec3[] {
  if (!place.bounds) return [];
  const [low, high] = place.bounds as [Vec3, Vec3];
  const world = compose(place.world_from_parent as Rows, place.parent_from_node as Rows);
  return boxCorners([low, high]).map((corner) => apply(world, corner));
}

/** The outline of the selection at rest; a box around it while something moves. */
export function Outline({ sight }: { sight: Sight }): JSX.Element | null {
  const now = selection.value;
  if (!now?.place) return null;
  const [width, height] = sight.size;
  if (now.outline && numbers.value.wanted > 0)
    return (
      <image
        class="outline"
        href={now.outline}
        width={width}
        height={height}
        preserveAspectRatio="none"
      />
    );
  const corners = cornersOf(now.place).map((corner) => sight.place(corner));
  return (
    <g class="box">
      {EDGES.map(([a, b]) => {
        const [from, to] = [corners[a!], corners[b!]];
        return from && to && <line x1={from.x} y1={from.y} x2={to.x} y2={to.y} />;
      })}
    </g>
  );
}
