// The ray of a pixel, for what is dragged on the picture.

import type { Camera } from "./camera";
import { right } from "./camera";
import { add, dot, mul, normalize, sub, type Vec3 } from "./vec";

export interface Ray {
  origin: Vec3;
  direction: Vec3;
}

type Halves = [number | null, number | null];

/** Half the extent of the view along both axes: one that is not given follows from the other. */
const both = ([x, y]: Halves, aspect: number): [number, number] =>
  x === null && y === null ? [aspect, 1] : [x ?? y! * aspect, y ?? x! / aspect];

/** The ray through a pixel; `null` for projections that the page does not know. */
export function rayThrough(
  camera: Camera,
  pixel: [number, number],
  size: [number, number],
): Ray | null {
  const [u, v] = [(pixel[0] / size[0]) * 2 - 1, 1 - (pixel[1] / size[1]) * 2];
  const { projection } = camera;
  const across = (x: number, y: number): Vec3 => add(mul(right(camera), x), mul(camera.up, y));
  if (projection.projection === "perspective") {
    const { tan_half_fov } = projection as { tan_half_fov: Halves };
    const [tx, ty] = both(tan_half_fov, size[0] / size[1]);
    const direction = normalize(add(camera.towards, across(u * tx, v * ty)));
    return { origin: camera.eye, direction };
  }
  if (projection.projection === "orthographic") {
    const { half_size } = projection as { half_size: Halves };
    const [hx, hy] = both(half_size, size[0] / size[1]);
    return { origin: add(camera.eye, across(u * hx, v * hy)), direction: camera.towards };
  }
  return null;
}

/** Where a ray meets the plane through a point; `null` if it runs along it or away from it. */
export function onPlane(ray: Ray, point: Vec3, normal: Vec3): Vec3 | null {
  const slope = dot(ray.direction, normal);
  if (Math.abs(slope) < 1e-4) return null;
  const t = dot(sub(point, ray.origin), normal) / slope;
  return t > 0 ? add(ray.origin, mul(ray.direction, t)) : null;
}

/** How far along the line through a point, in lengths of `axis`, a ray comes nearest to it. */
export function alongLine(ray: Ray, point: Vec3, axis: Vec3): number | null {
  const b = dot(ray.direction, axis);
  const denominator = 1 - b * b;
  if (denominator < 1e-4) return null;
  const w = sub(point, ray.origin);
  return (b * dot(ray.direction, w) - dot(axis, w)) / denominator;
}
