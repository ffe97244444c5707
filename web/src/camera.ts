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
  /** A plane that cuts the scene open: what has a value of 0 or more is left. */
  clip?: [number, number, number, number] | null;
}

/** A camera with the point it turns about and the direction that is up in the world. */
export interface Rig {
  camera: Camera;
  pivot: Vec3;
  worldUp: Vec3;
  /** The height along `worldUp` below which a drag does not take the eye; `null` for none. */
  ground: number | null;
}

/** Minimum and maximum corner. */
export type Box = [Vec3, Vec3];

/** Width and height of the picture in pixels. */
export type Size = [number, number];

const PARALLEL = "orthographic";

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

/**
 * Turns the camera about the pivot, radians: what is shown turns to the right by `yaw`, and the
 * camera rises by `pitch`. A drag to the right and down has both positive, as in three.js'
 * OrbitControls, Blender and f3d.
 */
export function orbit(rig: Rig, yaw: number, pitch: number): Rig {
  const { camera, pivot, worldUp } = rig;
  const tilt = Math.asin(Math.max(-1, Math.min(1, dot(camera.towards, worldUp))));
  const allowed = Math.max(-MOST_TILT, Math.min(MOST_TILT, tilt - pitch)) - tilt;
  const axis = right(camera);
  const turn = (v: Vec3): Vec3 => rotate(rotate(v, axis, allowed), worldUp, -yaw);
  const eye = add(pivot, turn(sub(camera.eye, pivot)));
  return { ...rig, camera: oriented({ ...camera, eye }, turn(camera.towards), worldUp) };
}

/**
 * The motion if it leaves the eye above the ground, or as far as it does: an eye above the ground
 * keeps a little distance from it.
 */
export function aboveGround(before: Rig, after: Rig): Rig {
  const { ground, worldUp } = before;
  if (ground === null) return after;
  const height = (rig: Rig): number => dot(rig.camera.eye, worldUp) - ground;
  const distance = length(sub(before.camera.eye, before.pivot));
  const least = Math.min(height(before), 0.01 * distance);
  const lack = least - height(after);
  if (least <= 0 || lack <= 0) return after;
  const lift = mul(worldUp, lack);
  const { camera, pivot } = after;
  return { ...after, camera: { ...camera, eye: add(camera.eye, lift) }, pivot: add(pivot, lift) };
}

/** Does what `orbit` does, but not below the ground. */
export function orbitAboveGround(rig: Rig, yaw: number, pitch: number): Rig {
  const whole = orbit(rig, yaw, pitch);
  if (aboveGround(rig, whole) === whole) return whole;
  // The part of the pitch that is possible, by bisection.
  let [low, high] = [0, 1];
  for (let i = 0; i < 30; i++) {
    const middle = (low + high) / 2;
    const next = orbit(rig, yaw, pitch * middle);
    if (aboveGround(rig, next) === next) low = middle;
    else high = middle;
  }
  return orbit(rig, yaw, pitch * low);
}

/** Turns the view about the eye: to the right by `yaw`, down by `pitch`, radians. */
export function look(rig: Rig, yaw: number, pitch: number): Rig {
  const { camera, worldUp } = rig;
  const distance = length(sub(rig.pivot, camera.eye));
  const turned = orbit({ ...rig, pivot: camera.eye }, yaw, pitch).camera;
  const pivot = add(turned.eye, mul(turned.towards, distance));
  return { ...rig, camera: turned, worldUp, pivot };
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

/** Depth of a point along the view. */
export const depthOf = (camera: Camera, point: Vec3): number =>
  dot(sub(point, camera.eye), camera.towards);

/** Half the extent of the view in the plane at this depth, along both axes. */
function extentAt(camera: Camera, size: Size, depth: number): [number, number] {
  const { projection } = camera;
  if (projection.projection === PARALLEL) {
    return resolved((projection as { half_size: [number | null, number | null] }).half_size, size);
  }
  const tangents =
    projection.projection === "perspective"
      ? (projection as { tan_half_fov: [number | null, number | null] }).tan_half_fov
      : ([null, 1] as [null, number]);
  const [x, y] = resolved(tangents, size);
  return [x * depth, y * depth];
}

/** The point that a pixel shows at this depth along the view; without one, at the pivot's. */
export function pointAt(rig: Rig, pixel: [number, number], size: Size, depth?: number): Vec3 {
  const { camera, pivot } = rig;
  const z = depth ?? depthOf(camera, pivot);
  const [x, y] = extentAt(camera, size, z);
  const [u, v] = [(pixel[0] / size[0]) * 2 - 1, 1 - (pixel[1] / size[1]) * 2];
  const aside = add(mul(right(camera), u * x), mul(camera.up, v * y));
  return add(add(camera.eye, mul(camera.towards, z)), aside);
}

/** Moves camera and pivot so that the point at this depth under one pixel gets under another. */
export function pan(
  rig: Rig,
  from: [number, number],
  to: [number, number],
  size: Size,
  depth?: number,
): Rig {
  const step = sub(pointAt(rig, from, size, depth), pointAt(rig, to, size, depth));
  const { camera, pivot } = rig;
  return { ...rig, camera: { ...camera, eye: add(camera.eye, step) }, pivot: add(pivot, step) };
}

/** Parallel views begin at least this many times their height before the pivot. */
const PARALLEL_DISTANCE = 2;

/**
 * Multiplies the distance from a point by `factor`; the point stays where it is in the picture.
 * Without a point it is the pivot. Parallel views grow.
 */
export function dolly(rig: Rig, factor: number, point: Vec3 = rig.pivot): Rig {
  const { camera, pivot } = rig;
  if (camera.projection.projection === PARALLEL) {
    const { half_size } = camera.projection as { half_size: (number | null)[] };
    const grown = half_size.map((s) => s && s * factor);
    const from = sub(camera.eye, point);
    const aside = sub(from, mul(camera.towards, dot(from, camera.towards)));
    const step = mul(aside, factor - 1);
    const middle = add(pivot, step);
    const least = PARALLEL_DISTANCE * Math.max(...grown.map((s) => s ?? 0));
    const eye = add(camera.eye, step);
    const lack = Math.max(0, least - dot(sub(middle, eye), camera.towards));
    const projection = { ...camera.projection, half_size: grown } as Projection;
    return {
      ...rig,
      pivot: middle,
      camera: {
        ...camera,
        eye: factor > 1 ? sub(eye, mul(camera.towards, lack)) : eye,
        projection,
      },
    };
  }
  const scaled = (p: Vec3): Vec3 => add(point, mul(sub(p, point), factor));
  return {
    ...rig,
    pivot: scaled(pivot),
    camera: {
      ...camera,
      eye: scaled(camera.eye),
      focus_distance: camera.focus_distance * factor,
    },
  };
}

/** The vertical angle of view, in radians, of a perspective that takes the place of parallels. */
const USUAL_ANGLE = (34 * Math.PI) / 180;

/**
 * The view with parallels instead of perspective, or the other way round: what is at the pivot
 * keeps its size. `before` is the perspective to return to.
 */
export function toggleParallel(rig: Rig, size: Size, before?: Projection): Rig {
  const { camera, pivot } = rig;
  if (camera.projection.projection === PARALLEL) {
    const half = extentAt(camera, size, 1)[1];
    const projection: Projection =
      before?.projection === "perspective"
        ? before
        : { projection: "perspective", tan_half_fov: [null, Math.tan(USUAL_ANGLE / 2)] };
    const distance = half / extentAt({ ...camera, projection }, size, 1)[1];
    const eye = sub(pivot, mul(camera.towards, distance));
    return { ...rig, camera: { ...camera, eye, projection, focus_distance: distance } };
  }
  const half = extentAt(camera, size, Math.max(depthOf(camera, pivot), 1e-9))[1];
  const projection = { projection: PARALLEL, half_size: [null, half] } as Projection;
  return { ...rig, camera: { ...camera, projection } };
}

/** Half the extent of the view along both axes: one that is not given follows from the other. */
function resolved(
  [x, y]: [number | null, number | null],
  size: [number, number],
): [number, number] {
  const aspect = size[0] / size[1];
  if (x === null && y === null) return [aspect, 1];
  return [x ?? y! * aspect, y ?? x! / aspect];
}

/**
 * The pixel that shows a point, from the upper left corner of a picture of this size, and the depth
 * of the point along the view. `null` behind the eye, and for projections that the page does not
 * know.
 */
export function project(
  camera: Camera,
  point: Vec3,
  size: [number, number],
): { x: number; y: number; depth: number } | null {
  const d = sub(point, camera.eye);
  const [x, y, depth] = [dot(d, right(camera)), dot(d, camera.up), dot(d, camera.towards)];
  if (!(depth > 0)) return null;
  const film = (u: number, v: number): { x: number; y: number; depth: number } => ({
    x: (u + 1) * 0.5 * size[0],
    y: (1 - v) * 0.5 * size[1],
    depth,
  });
  const { projection } = camera;
  if (projection.projection === "perspective") {
    const { tan_half_fov } = projection as { tan_half_fov: [number | null, number | null] };
    const [tx, ty] = resolved(tan_half_fov, size);
    return film(x / depth / tx, y / depth / ty);
  }
  if (projection.projection === "orthographic") {
    const { half_size } = projection as { half_size: [number | null, number | null] };
    const [hx, hy] = resolved(half_size, size);
    return film(x / hx, y / hy);
  }
  return null;
}

/** World units that one pixel is wide at the pivot. */
export function pixelAtPivot(rig: Rig, size: Size): number {
  const depth = Math.abs(depthOf(rig.camera, rig.pivot)) || 1;
  return (2 * extentAt(rig.camera, size, depth)[1]) / size[1];
}

/** The share of the way from the middle of the picture to its edges that a framed box fills. */
const FILL = 0.9;

/** Sees a whole box, from where the camera looks now, and turns about its middle. */
export function frameBox(rig: Rig, [low, high]: Box, size: Size): Rig {
  const { camera } = rig;
  const center = mul(add(low, high), 0.5);
  const radius = Math.max(length(sub(high, low)) / 2, 1e-9);
  const axes = [right(camera), camera.up, camera.towards];
  const corners = [...Array(8).keys()].map((i) => {
    const corner: Vec3 = [0, 1, 2].map((axis) => ((i >> axis) & 1 ? high : low)[axis]) as Vec3;
    return axes.map((axis) => dot(sub(corner, center), axis));
  });
  const aspect = size[0] / size[1];
  let { projection } = camera;
  let distance = 0;
  if (projection.projection === PARALLEL) {
    const half = Math.max(...corners.map(([x, y]) => Math.max(Math.abs(x) / aspect, Math.abs(y))));
    projection = { projection: PARALLEL, half_size: [null, Math.max(half, 1e-9) / FILL] };
    distance = 4 * radius;
  } else {
    const [x, y] = extentAt(camera, size, FILL);
    const needed = corners.map((c) => Math.max(Math.abs(c[0]) / x, Math.abs(c[1]) / y) - c[2]);
    distance = Math.max(...needed, 1.001 * radius);
  }
  return {
    ...rig,
    pivot: center,
    camera: {
      ...camera,
      eye: sub(center, mul(camera.towards, distance)),
      projection,
      focus_distance: distance,
    },
  };
}

/** A view along an axis, of a box. `direction` is where the camera looks. */
export function preset(rig: Rig, direction: Vec3, box: Box, size: Size): Rig {
  const vertical = Math.abs(dot(direction, rig.worldUp)) > 0.99;
  const up: Vec3 = vertical
    ? Math.abs(rig.worldUp[1]) > 0.5
      ? [0, 0, -1]
      : [0, 1, 0]
    : rig.worldUp;
  return frameBox({ ...rig, camera: oriented(rig.camera, direction, up) }, box, size);
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

/** What a rig needs to know of the scene. */
export interface Scenery {
  /** The box around the subject. */
  subject: Box;
  up: Vec3;
  ground: number | null;
}

/** A rig for a camera: the pivot is where it looks at the middle of the subject. */
export function rigOf(camera: Camera, { subject, up, ground }: Scenery): Rig {
  const center = mul(add(subject[0], subject[1]), 0.5);
  const radius = length(sub(subject[1], subject[0])) / 2;
  const depth = depthOf(camera, center);
  const distance = depth > 0.01 * radius ? depth : Math.max(radius, 1e-3);
  return {
    camera,
    worldUp: normalize(up, [0, 1, 0]),
    pivot: add(camera.eye, mul(camera.towards, distance)),
    ground,
  };
}

/**
 * The rig with another camera: it turns about the same point if the camera looks at it, else about
 * one as far away as that was.
 */
export function withCamera(rig: Rig, camera: Camera): Rig {
  const depth = depthOf(camera, rig.pivot);
  const distance = length(sub(rig.pivot, rig.camera.eye));
  const axis = add(camera.eye, mul(camera.towards, depth));
  const isSeen = depth > 0 && length(sub(axis, rig.pivot)) < 1e-6 * (depth + distance);
  const pivot = isSeen ? rig.pivot : add(camera.eye, mul(camera.towards, distance));
  return { ...rig, camera, pivot };
}
