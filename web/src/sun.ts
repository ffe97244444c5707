// The position of a light in the sky: its elevation above the horizon, and its azimuth.

import { add, cross, dot, mul, normalize, type Vec3 } from "./vec";

/**
 * Degrees: `height` over the horizon, `side` from ahead (-z, or +y where z is up) to the left, seen
 * from above.
 */
export interface SunPosition {
  height: number;
  side: number;
}

const DEGREES = 180 / Math.PI;

/** Ahead and left, on the ground. */
function axes(up: Vec3): [Vec3, Vec3] {
  const ahead: Vec3 = Math.abs(up[2]) > 0.9 ? [0, 1, 0] : [0, 0, -1];
  return [ahead, cross(up, ahead)];
}

/** The position of a light whose rays travel in a direction. */
export function sunPosition(direction: Vec3, up: Vec3): SunPosition {
  const to = mul(normalize(direction), -1);
  const [ahead, left] = axes(up);
  const height = Math.asin(Math.max(-1, Math.min(1, dot(to, up)))) * DEGREES;
  return { height, side: Math.atan2(dot(to, left), dot(to, ahead)) * DEGREES };
}

/** The direction in which its rays travel. */
export function sunDirection({ height, side }: SunPosition, up: Vec3): Vec3 {
  const [ahead, left] = axes(up);
  const [h, s] = [height / DEGREES, side / DEGREES];
  const level = add(mul(ahead, Math.cos(s)), mul(left, Math.sin(s)));
  return mul(add(mul(level, Math.cos(h)), mul(up, Math.sin(h))), -1);
}
