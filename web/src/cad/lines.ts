// Lines of the world in the picture, and round steps: pure functions.

import { type Camera, project } from "../camera";
import { add, dot, mul, sub, type Vec3 } from "../vec";

export interface Segment {
  x1: number;
  y1: number;
  x2: number;
  y2: number;
}

/** A line of the world in the picture: the part of it that is at least `near` before the eye. */
export function segment(
  camera: Camera,
  size: [number, number],
  [a, b]: [Vec3, Vec3],
  near: number,
): Segment | null {
  const depth = (p: Vec3): number => dot(sub(p, camera.eye), camera.towards);
  const [da, db] = [depth(a), depth(b)];
  if (da < near && db < near) return null;
  const cut = (): Vec3 => add(a, mul(sub(b, a), (near - da) / (db - da)));
  const from = project(camera, da < near ? cut() : a, size);
  const to = project(camera, db < near ? cut() : b, size);
  return from && to && { x1: from.x, y1: from.y, x2: to.x, y2: to.y };
}

/** The round number, of 1, 2 and 5 times a power of ten, that is nearest below. */
export function roundStep(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const factor = [5, 2, 1].find((f) => f * power <= value * (1 + 1e-12)) ?? 1;
  return factor * power;
}

export interface Grid {
  /** Size of a cell. */
  step: number;
  lines: [Vec3, Vec3][];
  /** Where lines have their coordinate written. */
  labels: { at: Vec3; text: string }[];
}

/** Cells from the middle of the grid to its border. */
const CELLS = 10;

/** A grid on the ground of a scene: across the upward axis, at the lowest point. */
export function grid([low, high]: [Vec3, Vec3], up: Vec3): Grid {
  const vertical = Math.abs(up[2]) > 0.5 ? 2 : Math.abs(up[0]) > 0.5 ? 0 : 1;
  const [u, v] = [0, 1, 2].filter((axis) => axis !== vertical);
  const extent = Math.max(high[u] - low[u], high[v] - low[v], 1e-9);
  const step = roundStep(extent / 8);
  const middle = [u, v].map((axis) => Math.round((low[axis] + high[axis]) / 2 / step));
  const point = (i: number, j: number): Vec3 => {
    const p: Vec3 = [0, 0, 0];
    p[u] = i * step;
    p[v] = j * step;
    p[vertical] = low[vertical];
    return p;
  };
  const lines: [Vec3, Vec3][] = [];
  const labels: Grid["labels"] = [];
  const written = (k: number): string => Number((k * step).toPrecision(6)).toString();
  for (let k = -CELLS; k <= CELLS; k++) {
    const [i, j] = [middle[0] + k, middle[1] + k];
    lines.push([point(i, middle[1] - CELLS), point(i, middle[1] + CELLS)]);
    lines.push([point(middle[0] - CELLS, j), point(middle[0] + CELLS, j)]);
    if (k % 2 === 0) {
      labels.push({ at: point(i, middle[1] + CELLS), text: written(i) });
      labels.push({ at: point(middle[0] + CELLS, j), text: written(j) });
    }
  }
  return { step, lines, labels };
}
