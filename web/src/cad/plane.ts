// The section plane of a camera: pure functions.

import type { Camera } from "../camera";
import { dot, mul, normalize, type Vec3 } from "../vec";

/** A plane `a x + b y + c z + d = 0`; what has a value of 0 or more is left. */
export type Plane = [number, number, number, number];

/** A section as it is set: what lies beyond `offset` along the unit vector `normal` is cut away. */
export interface Section {
  normal: Vec3;
  offset: number;
}

export function planeOf({ normal, offset }: Section): Plane {
  return [-normal[0], -normal[1], -normal[2], offset];
}

export function sectionOf([a, b, c, d]: Plane): Section {
  const size = Math.hypot(a, b, c) || 1;
  const normal = normalize([-a, -b, -c]).map((v) => v + 0) as Vec3;
  return { normal, offset: d / size };
}

/** The same plane with the other side cut away. */
export const flipped = ({ normal, offset }: Section): Section => ({
  normal: mul(normal, -1),
  offset: -offset,
});

export const AXES: { name: string; axis: Vec3 }[] = [
  { name: "X", axis: [1, 0, 0] },
  { name: "Y", axis: [0, 1, 0] },
  { name: "Z", axis: [0, 0, 1] },
];

/** The axis that a section is perpendicular to, if any. */
export const axisOf = ({ normal }: Section): string | undefined =>
  AXES.find(({ axis }) => Math.abs(dot(axis, normal)) > 1 - 1e-9)?.name;

/**
 * 1 if the place of a section is given along its normal, -1 if against it: a section across an axis
 * is at a coordinate, whichever side is cut away.
 */
export function sign({ normal }: Section): number {
  const largest = normal.reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
  return largest < 0 ? -1 : 1;
}

/** The least and greatest place of a box along a direction. */
export function span([low, high]: [Vec3, Vec3], along: Vec3): [number, number] {
  const ends = along.map((v, i) => [v * low[i], v * high[i]].sort((a, b) => a - b));
  const sum = (which: number): number => ends.reduce((total, pair) => total + pair[which], 0);
  return [sum(0), sum(1)];
}

/** The axis that the camera looks along, more or less. */
export const facing = ({ towards }: Camera): Vec3 =>
  AXES.map(({ axis }) => axis).reduce((a, b) =>
    Math.abs(dot(b, towards)) > Math.abs(dot(a, towards)) ? b : a,
  );

/** A section through the middle of a box, perpendicular to an axis; the camera's side is cut. */
export function through(axis: Vec3, bounds: [Vec3, Vec3], camera: Camera): Section {
  const normal = mul(axis, dot(axis, camera.towards) > 0 ? -1 : 1).map((v) => v + 0) as Vec3;
  const [low, high] = span(bounds, normal);
  return { normal, offset: (low + high) / 2 };
}
