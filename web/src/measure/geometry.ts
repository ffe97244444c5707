// What is measured between points that were picked: pure functions.

import type { PickedHit } from "../protocol.gen";
import { add, cross, dot, length, mul, normalize, sub, type Vec3 } from "../vec";

/** What a point was picked on: the nearest of these within reach of the pointer. */
export type Snap = "corner" | "edge" | "surface";

export interface Point {
  position: Vec3;
  /** Geometric normal on the side that is seen. */
  facing: Vec3;
  snap: Snap;
  /** How thick the body is there; `null` if it has no opposite side. */
  thickness: number | null;
}

export const KINDS = [
  { kind: "distance", name: "Distance", points: 2, hint: "two points" },
  { kind: "angle", name: "Angle", points: 3, hint: "a point, the corner of the angle, a point" },
  { kind: "faces", name: "Faces", points: 2, hint: "two faces" },
  { kind: "thickness", name: "Thickness", points: 1, hint: "a wall" },
] as const;

export type Kind = (typeof KINDS)[number]["kind"];

export interface Measure {
  id: number;
  kind: Kind;
  points: Point[];
}

/** Where a point of the world is in the picture, in pixels. */
export type Place = (point: Vec3) => { x: number; y: number } | null;

/** The point of the segment from `a` to `b` that is nearest to `p`. */
export function nearestOnSegment(p: Vec3, a: Vec3, b: Vec3): Vec3 {
  const along = sub(b, a);
  const squared = dot(along, along);
  const s = squared > 0 ? dot(sub(p, a), along) / squared : 0;
  return add(a, mul(along, Math.max(0, Math.min(1, s))));
}

/** A hit farther from the pointer than this, in pixels, is beside it. */
const BESIDE = 1;

/**
 * The point that a click picks: a corner of the face within `reach` pixels, else a sharp edge or
 * border, else the surface. Beside a body there are only its corners and edges.
 */
export function snapped(
  hit: PickedHit,
  at: [number, number],
  place: Place,
  reach: number,
): Point | null {
  const from = (position: Vec3): number => {
    const seen = place(position);
    return seen ? Math.hypot(seen.x - at[0], seen.y - at[1]) : Infinity;
  };
  const nearest = (points: Vec3[]): Vec3 | undefined =>
    points.filter((p) => from(p) <= reach).sort((a, b) => from(a) - from(b))[0];
  const corners = hit.corners as Vec3[];
  // A corner between two edges that only divide a smooth surface is none of the body.
  const isCorner = (i: number): boolean =>
    hit.sharp[i] || hit.sharp[(i + corners.length - 1) % corners.length];
  const corner = nearest(corners.filter((_, i) => isCorner(i)));
  const edges = corners.flatMap((a, i) =>
    hit.sharp[i] ? [nearestOnSegment(hit.position, a, corners[(i + 1) % corners.length])] : [],
  );
  const edge = corner ? undefined : nearest(edges);
  if (!corner && !edge && from(hit.position) > BESIDE) return null;
  return {
    position: corner ?? edge ?? hit.position,
    facing: hit.facing,
    snap: corner ? "corner" : edge ? "edge" : "surface",
    thickness: hit.thickness,
  };
}

/** The angle between two directions in degrees, exact for small ones too. */
export function angleBetween(a: Vec3, b: Vec3): number {
  const [u, v] = [normalize(a), normalize(b)];
  return (Math.atan2(length(cross(u, v)), dot(u, v)) * 180) / Math.PI;
}

/** A number of a measure as text: six digits, without needless zeros. */
export function written(value: number): string {
  return Number(value.toPrecision(6)).toString();
}

export interface Result {
  /** The measure in a few words, for its label. */
  label: string;
  /** Further numbers, by name. */
  details: [string, string][];
}

/** Faces that are parallel within this angle have a distance, degrees. */
const PARALLEL = 0.1;

/** What a complete measure has found. */
export function result({ kind, points }: Measure): Result {
  const [a, b, c] = points;
  switch (kind) {
    case "distance": {
      const d = sub(b.position, a.position);
      return {
        label: written(length(d)),
        details: (["dx", "dy", "dz"] as const).map((name, i) => [name, written(d[i])]),
      };
    }
    case "angle": {
      const [p, q] = [sub(a.position, b.position), sub(c.position, b.position)];
      return {
        label: `${written(angleBetween(p, q))}°`,
        details: [["sides", `${written(length(p))}, ${written(length(q))}`]],
      };
    }
    case "faces": {
      const angle = angleBetween(a.facing, b.facing);
      const isParallel = Math.min(angle, 180 - angle) < PARALLEL;
      const apart = Math.abs(dot(sub(b.position, a.position), a.facing));
      return {
        label: isParallel ? `${written(apart)} (parallel)` : `${written(angle)}°`,
        details: [
          ["between normals", `${written(angle)}°`],
          ["between faces", `${written(180 - angle)}°`],
        ],
      };
    }
    case "thickness":
      return {
        label: a.thickness === null ? "no opposite side" : written(a.thickness),
        details: [],
      };
  }
}

/** The point on the opposite side of a wall. */
export const opposite = (point: Point): Vec3 | null =>
  point.thickness === null ? null : sub(point.position, mul(point.facing, point.thickness));

/** Measures as lines of a table: name, value, points. */
export function table(measures: Measure[]): string {
  const place = (p: Point): string => p.position.map(written).join(" ");
  return measures
    .map((m) => {
      const { label, details } = result(m);
      const facts = details.map(([name, value]) => `${name} ${value}`);
      return [m.kind, label, ...facts, ...m.points.map(place)].join("\t");
    })
    .join("\n");
}
