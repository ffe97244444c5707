// The camera in the server's form, and its motions. These are pure functions; controls.ts has the
// mouse.

import { add, cross, dot, length, mul, normalize, rotate, sub, type Vec3 } from "./vec";

export type Projection =
  | { projection: "perspective"; tan_half_fov: [number | null, number | null] }
  | { projection: "orthographic"; half_size: [number | null, number | null] }
  | { projection: string; [key: string]: unknown };

export interface Camera {
  name: string;
  eye: Vec3;
  towards: Vec3;
  up: Vec3;
  projection: Projection;
  aperture_radius: number;
  focus_distance: number;
  resolution: [number, number] | null;
}

/** A camera with the point it turns about and the direction that is up in the world. */
export interface Rig {
  camera: Camera;
  pivot: Vec3;
  worldUp: Vec3;
}

export const right = (camera: Camera): Vec3 => cross(camera.towards, camera.up);

/** The same camera looking along `towards`, upright as far as it can be. */
export function oriented(camera: Camera, towards: Vec3, up: Vec3): Camera {
  const t = normalize(towards, camera.towards);
  let r = cross(t, up);
  if (length(r) < 1e-6) r = right(camera);
  r = normalize(r, [1, 0, 0]);
  return { ...camera, towards: t, up: cross(r, t) };
}

/**
 * How far the view may tilt from the horizon: not quite to the pole, where left and right would
 * swap.
 */
const MOST_TILT = Math.PI / 2 - 0.01;

/** Turns the camera about the pivot: to the right by `yaw`, up by `pitch`, radians. */
export function orbit(rig: Rig, yaw: number, pitch: number): Rig {
  const { camera, pivot, worldUp } = rig;
  const tilt = Math.asin(Math.max(-1, Math.min(1, dot(camera.towards, worldUp))));
  const allowed = Math.max(-MOST_TILT, Math.min(MOST_TILT, tilt - pitch)) - tilt;
  const axis = right(camera);
  const turn = (v: Vec3): Vec3 => rotate(rotate(v, axis, allowed), worldUp, -yaw);
  const eye = add(pivot, turn(sub(camera.eye, pivot)));
  return { ...rig, camera: oriented({ ...camera, eye }, turn(camera.towards), worldUp) };
}

/** Turns the view about the eye. */
export function look(rig: Rig, yaw: number, pitch: number): Rig {
  const { camera, worldUp } = rig;
  const distance = length(sub(rig.pivot, camera.eye));
  const turned = orbit({ ...rig, pivot: camera.eye }, yaw, pitch).camera;
  return { camera: turned, worldUp, pivot: add(turned.eye, mul(turned.towards, distance)) };
}

/** Moves camera and pivot along the camera's own axes. */
export function move(rig: Rig, alongRight: number, alongUp: number, forward: number): Rig {
  const { camera } = rig;
  const step = add(
    add(mul(right(camera), alongRight), mul(camera.up, alongUp)),
    mul(camera.towards, forward),
  );
  return { ...rig, camera: { ...camera, eye: add(camera.eye, step) }, pivot: add(rig.pivot, step) };
}

/** Moves the eye to the pivot: the distance is multiplied by `factor`. Parallel views grow. */
export function dolly(rig: Rig, factor: number): Rig {
  const { camera, pivot } = rig;
  const from = sub(camera.eye, pivot);
  const projection = camera.projection;
  const scaled =
    projection.projection === "orthographic"
      ? {
          ...projection,
          half_size: (projection as { half_size: (number | null)[] }).half_size.map(
            (s) => s && s * factor,
          ),
        }
      : projection;
  const ratio = length(from) > 0 ? factor : 1;
  const focus = camera.focus_distance * ratio;
  return {
    ...rig,
    camera: {
      ...camera,
      eye: add(pivot, mul(from, ratio)),
      projection: scaled as Projection,
      focus_distance: focus,
    },
  };
}

/** World units that one pixel is wide at the pivot. */
export function pixelAtPivot(rig: Rig, size: [number, number]): number {
  const { camera, pivot } = rig;
  const projection = camera.projection;
  if (projection.projection === "orthographic") {
    const [x, y] = (projection as { half_size: [number | null, number | null] }).half_size;
    return y !== null ? (2 * y) / size[1] : (2 * (x ?? 1)) / size[0];
  }
  const distance = Math.abs(dot(sub(pivot, camera.eye), camera.towards)) || 1;
  if (projection.projection === "perspective") {
    const [x, y] = (projection as { tan_half_fov: [number | null, number | null] }).tan_half_fov;
    return (distance * 2 * (y ?? x ?? 1)) / (y !== null ? size[1] : size[0]);
  }
  return (distance * 2) / size[1];
}

/** Half of the view's angle that is smaller, radians. */
function halfAngle(camera: Camera, size: [number, number]): number {
  const projection = camera.projection;
  if (projection.projection !== "perspective") return Math.PI / 8;
  const [x, y] = (projection as { tan_half_fov: [number | null, number | null] }).tan_half_fov;
  const aspect = size[0] / size[1];
  const [tx, ty] = [x ?? (y ?? 0.5) * aspect, y ?? (x ?? 0.5) / aspect];
  return Math.atan(Math.min(tx, ty));
}

/** Sees a whole ball, from where the camera looks now. */
export function frameBall(rig: Rig, center: Vec3, radius: number, size: [number, number]): Rig {
  const { camera } = rig;
  const distance = Math.max(radius, 1e-6) / Math.sin(halfAngle(camera, size));
  const projection =
    camera.projection.projection === "orthographic"
      ? { ...camera.projection, half_size: [null, radius * 1.05] }
      : camera.projection;
  const eye = sub(center, mul(camera.towards, distance * 1.05));
  return {
    ...rig,
    pivot: center,
    camera: { ...camera, eye, projection: projection as Projection, focus_distance: distance },
  };
}

/** A view along an axis, of a ball. `direction` is where the camera looks. */
export function preset(
  rig: Rig,
  direction: Vec3,
  center: Vec3,
  radius: number,
  size: [number, number],
): Rig {
  const vertical = Math.abs(dot(direction, rig.worldUp)) > 0.99;
  const up: Vec3 = vertical
    ? Math.abs(rig.worldUp[1]) > 0.5
      ? [0, 0, -1]
      : [0, 1, 0]
    : rig.worldUp;
  return frameBall({ ...rig, camera: oriented(rig.camera, direction, up) }, center, radius, size);
}

/** The vertical angle of view in degrees, of perspective cameras. */
export function fieldOfView(camera: Camera, size: [number, number]): number | null {
  if (camera.projection.projection !== "perspective") return null;
  const [x, y] = (camera.projection as { tan_half_fov: [number | null, number | null] })
    .tan_half_fov;
  return (Math.atan(y ?? ((x ?? 1) * size[1]) / size[0]) * 360) / Math.PI;
}

/** The same camera with this vertical angle of view. */
export function withFieldOfView(camera: Camera, degrees: number): Camera {
  const tangent = Math.tan((Math.max(1, Math.min(170, degrees)) * Math.PI) / 360);
  return { ...camera, projection: { projection: "perspective", tan_half_fov: [null, tangent] } };
}

/** A rig for a camera: the pivot is where it looks at the middle of the scene. */
export function rigOf(camera: Camera, bounds: [Vec3, Vec3], worldUp: Vec3): Rig {
  const center = mul(add(bounds[0], bounds[1]), 0.5);
  const radius = length(sub(bounds[1], bounds[0])) / 2;
  const depth = dot(sub(center, camera.eye), camera.towards);
  const distance = depth > 0.01 * radius ? depth : Math.max(radius, 1e-3);
  return {
    camera,
    worldUp: normalize(worldUp, [0, 1, 0]),
    pivot: add(camera.eye, mul(camera.towards, distance)),
  };
}
