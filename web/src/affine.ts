// Affine maps as three rows of four numbers, as the server writes them.

import { add, dot, mul, rotate, type Vec3 } from "./vec";

export type Row = [number, number, number, number];
export type Rows = [Row, Row, Row];

export const IDENTITY: Rows = [
  [1, 0, 0, 0],
  [0, 1, 0, 0],
  [0, 0, 1, 0],
];

const INDICES = [0, 1, 2] as const;

const column = (m: Rows, j: 0 | 1 | 2 | 3): Vec3 => [m[0][j], m[1][j], m[2][j]];

const fromColumns = (x: Vec3, y: Vec3, z: Vec3, t: Vec3): Rows =>
  INDICES.map((i) => [x[i], y[i], z[i], t[i]]) as unknown as Rows;

const linear = (row: Row): Vec3 => [row[0], row[1], row[2]];

/** The image of a direction. */
export const applyToVector = (m: Rows, v: Vec3): Vec3 =>
  INDICES.map((i) => dot(linear(m[i]), v)) as Vec3;

/** The image of a point. */
export const apply = (m: Rows, p: Vec3): Vec3 => add(applyToVector(m, p), column(m, 3));

/** First `b`, then `a`. */
export const compose = (a: Rows, b: Rows): Rows =>
  fromColumns(
    applyToVector(a, column(b, 0)),
    applyToVector(a, column(b, 1)),
    applyToVector(a, column(b, 2)),
    apply(a, column(b, 3)),
  );

/** The inverse; `null` of a map that flattens. */
export function inverse(m: Rows): Rows | null {
  const [a, b, c] = INDICES.map((i) => linear(m[i])) as [Vec3, Vec3, Vec3];
  const cross = (u: Vec3, v: Vec3): Vec3 => [
    u[1] * v[2] - u[2] * v[1],
    u[2] * v[0] - u[0] * v[2],
    u[0] * v[1] - u[1] * v[0],
  ];
  const determinant = dot(a, cross(b, c));
  if (!Number.isFinite(1 / determinant)) return null;
  // The columns of the inverse are the products of the rows.
  const [x, y, z] = [cross(b, c), cross(c, a), cross(a, b)].map((v) => mul(v, 1 / determinant));
  const turned = fromColumns(x!, y!, z!, [0, 0, 0]);
  return fromColumns(x!, y!, z!, mul(applyToVector(turned, column(m, 3)), -1));
}

export const translation = (by: Vec3): Rows => fromColumns([1, 0, 0], [0, 1, 0], [0, 0, 1], by);

/** The turn about a unit axis through a point, by an angle in radians. */
export function turnAbout(center: Vec3, axis: Vec3, angle: number): Rows {
  const turn = fromColumns(
    rotate([1, 0, 0], axis, angle),
    rotate([0, 1, 0], axis, angle),
    rotate([0, 0, 1], axis, angle),
    [0, 0, 0],
  );
  return compose(compose(translation(center), turn), translation(mul(center, -1)));
}
