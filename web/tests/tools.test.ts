import { describe, expect, it } from "vitest";
import { grid, roundStep, segment } from "../src/cad/lines";
import { axisOf, facing, flipped, planeOf, sectionOf, sign, through } from "../src/cad/plane";
import type { Camera } from "../src/camera";
import { colour, paint } from "../src/compare/colormap";
import {
  at,
  BARS,
  errors,
  extent,
  histogram,
  type Linear,
  mean,
  NUMBERS,
  numberToHalf,
  resized,
} from "../src/compare/linear";
import { angleBetween, type Point, result, snapped, table } from "../src/measure/geometry";
import type { PickedHit } from "../src/protocol.gen";
import type { Vec3 } from "../src/vec";

const point = (
  position: Vec3,
  facing: Vec3 = [0, 0, 1],
  thickness: number | null = null,
): Point => ({
  position,
  facing,
  snap: "surface",
  thickness,
});

describe("measures", () => {
  it("have a distance and its parts along the axes", () => {
    const points = [point([1, 2, 3]), point([4, 6, 3])];
    const { label, details } = result({ id: 1, kind: "distance", points });
    expect(label).toBe("5");
    expect(details).toEqual([
      ["dx", "3"],
      ["dy", "4"],
      ["dz", "0"],
    ]);
  });
  it("have the angle of three points, also a tiny one", () => {
    const points = [point([1, 0, 0]), point([0, 0, 0]), point([0, 2, 0])];
    expect(result({ id: 1, kind: "angle", points }).label).toBe("90°");
    expect(angleBetween([1, 0, 0], [1, 1e-6, 0])).toBeCloseTo((1e-6 * 180) / Math.PI, 12);
  });
  it("of parallel faces are their distance, of others the angle of the normals", () => {
    const apart = [point([0, 0, 1]), point([5, 5, -2], [0, 0, -1])];
    expect(result({ id: 1, kind: "faces", points: apart }).label).toBe("3 (parallel)");
    const across = [point([0, 0, 1]), point([0, 0, 0], [1, 0, 0])];
    expect(result({ id: 1, kind: "faces", points: across }).label).toBe("90°");
  });
  it("say so if a wall has no opposite side", () => {
    const wall = (thickness: number | null): string =>
      result({ id: 1, kind: "thickness", points: [point([0, 0, 0], [0, 0, 1], thickness)] }).label;
    expect(wall(0.25)).toBe("0.25");
    expect(wall(null)).toBe("no opposite side");
  });
  it("are copied as a line of a table", () => {
    const measure = {
      id: 1,
      kind: "distance" as const,
      points: [point([0, 0, 0]), point([0, 2, 0])],
    };
    expect(table([measure])).toBe("distance\t2\tdx 0\tdy 2\tdz 0\t0 0 0\t0 2 0");
  });
  it("snap to a corner, then to a sharp edge, and never to what only divides a face", () => {
    const hit = {
      position: [0.5, 0.3, 0],
      facing: [0, 0, 1],
      thickness: null,
      corners: [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
      ],
      sharp: [true, true, false],
    } as unknown as PickedHit;
    const place = (p: Vec3) => ({ x: p[0] * 100, y: p[1] * 100 });
    const near = (at: [number, number], position: Vec3) =>
      snapped({ ...hit, position }, at, place, 12);
    expect(near([97, 4], [0.97, 0.04, 0])).toMatchObject({ snap: "corner", position: [1, 0, 0] });
    expect(near([50, 6], [0.5, 0.06, 0])).toMatchObject({ snap: "edge", position: [0.5, 0, 0] });
    // The diagonal is no edge of the body.
    expect(near([51, 49], [0.51, 0.49, 0])?.snap).toBe("surface");
    expect(near([80, 40], [0.8, 0.4, 0])).toMatchObject({
      snap: "surface",
      position: [0.8, 0.4, 0],
    });
    // Beside the body, there are only corners and edges.
    expect(near([50, -7], [0.5, 0.005, 0])).toMatchObject({ snap: "edge" });
    expect(near([50, 49], [0.5, 0.41, 0])).toBeNull();
  });
  it("of a section begin across the axis that is looked along", () => {
    const camera = { towards: [0.1, -0.9, 0.4] } as unknown as Camera;
    expect(facing(camera)).toEqual([0, 1, 0]);
  });
});

const picture = (values: number[], size: [number, number]): Linear => ({
  halves: Uint16Array.from(values, numberToHalf),
  size,
});

describe("linear pictures", () => {
  it("round to the nearest half float, as their numbers say", () => {
    for (let bits = 0; bits < 65536; bits += 7) {
      const value = NUMBERS[bits];
      if (!Number.isNaN(value) && value !== 0) expect(numberToHalf(value)).toBe(bits);
    }
    expect(numberToHalf(65519.9)).toBe(0x7bff);
    expect(numberToHalf(65520)).toBe(0x7c00);
    expect(numberToHalf(-1)).toBe(0xbc00);
    expect(Number.isNaN(NUMBERS[numberToHalf(Number.NaN)])).toBe(true);
  });
  it("keep their mean in another size, and are the same in their own", () => {
    const grey = picture([0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1], [4, 1]);
    expect(resized(grey, [4, 1])).toBe(grey);
    const half = resized(grey, [2, 1]);
    expect(half.size).toEqual([2, 1]);
    expect((at(half, 0, 0)![0] + at(half, 1, 0)![0]) / 2).toBeCloseTo(0.5, 2);
    expect(at(half, 2, 0)).toBeNull();
  });
  it("have absolute and relative errors", () => {
    const [a, b] = [picture([1, 1, 1], [1, 1]), picture([0.5, 0.5, 0.5], [1, 1])];
    expect(errors(a, b, "absolute")[0]).toBeCloseTo(0.5, 6);
    expect(errors(a, b, "relative")[0]).toBeCloseTo(0.5 / 0.51, 6);
    expect(mean(Float32Array.from([1, NaN, 3]))).toBe(2);
  });
  it("have a histogram in which every value is counted", () => {
    const h = histogram(picture([0, 0.25, 1000, 1, 1, 1], [2, 1]), true, 64);
    for (const counts of h.counts) expect(counts.reduce((a, b) => a + b)).toBe(2);
    expect(h.counts[0][0]).toBe(1);
    expect(h.counts[2][BARS - 1]).toBe(1);
  });
});

describe("false colours", () => {
  it("go from end to end, and what is nothing is black", () => {
    expect(colour("viridis", 0)).toEqual([68, 1, 84]);
    expect(colour("magma", 2)).toEqual([252, 253, 191]);
    expect(colour("turbo", 0.5)[1]).toBeGreaterThan(200);
    const out = new Uint8ClampedArray(12);
    paint(Float32Array.from([0, 2, 4]), [2, 4], "magma", 0, out);
    expect([...out]).toEqual([0, 0, 0, 255, 0, 0, 4, 255, 252, 253, 191, 255]);
    expect(extent(Float32Array.from([0, 2, 4, NaN, Infinity]), 0)).toEqual([2, 4]);
    expect(extent(Float32Array.from([0]), 0)).toBeNull();
  });
});

const camera: Camera = {
  name: "",
  eye: [0, 0, 5],
  towards: [0, 0, -1],
  up: [0, 1, 0],
  projection: { projection: "perspective", tan_half_fov: [null, 0.5] },
  aperture_radius: 0,
  focus_distance: 5,
  resolution: null,
};
const bounds: [Vec3, Vec3] = [
  [-1, -2, -3],
  [1, 2, 3],
];

describe("sections", () => {
  it("go through the middle and open towards the viewer", () => {
    const section = through([0, 0, 1], bounds, camera);
    expect(section).toEqual({ normal: [0, 0, 1], offset: 0 });
    const [a, b, c, d] = planeOf(section);
    const value = (p: Vec3): number => a * p[0] + b * p[1] + c * p[2] + d;
    expect(value(camera.eye)).toBeLessThan(0);
    expect(value([0, 0, -3])).toBeGreaterThan(0);
  });
  it("across an axis are at a coordinate, whichever side is cut", () => {
    const at = { normal: [0, 0, -1] as Vec3, offset: -150 };
    expect([at, flipped(at)].map((s) => s.offset * sign(s))).toEqual([150, 150]);
  });
  it("come back from their plane, and from their other side", () => {
    const section = { normal: [0, 1, 0] as Vec3, offset: 1.5 };
    expect(sectionOf(planeOf(section))).toEqual(section);
    expect(axisOf(section)).toBe("Y");
    const other = flipped(flipped(section));
    expect(other.normal[1]).toBe(1);
    expect(other.offset).toBe(1.5);
    expect(sectionOf([0, -2, 0, 3])).toEqual(section);
  });
});

describe("the grid", () => {
  it("has cells of 1, 2 or 5", () => {
    expect([0.7, 1, 3.2, 49, 50, 99].map(roundStep)).toEqual([0.5, 1, 2, 20, 50, 50]);
  });
  it("lies on the ground, with coordinates", () => {
    const { step, lines, labels } = grid(bounds, [0, 1, 0]);
    expect(step).toBe(0.5);
    expect(lines.length).toBe(42);
    expect(lines.every(([a, b]) => a[1] === -2 && b[1] === -2)).toBe(true);
    expect(labels.some(({ text }) => text === "-1")).toBe(true);
    const above = grid(
      [
        [0, 0, 7],
        [8, 8, 9],
      ],
      [0, 0, 1],
    );
    expect(above.lines.every(([a]) => a[2] === 7)).toBe(true);
  });
  it("is cut where it comes behind the eye", () => {
    const line = segment(
      camera,
      [100, 100],
      [
        [0, -1, 0],
        [0, -1, 100],
      ],
      0.01,
    );
    expect(line && [line.x1, line.y1, line.x2, line.y2].every(Number.isFinite)).toBe(true);
    expect(
      segment(
        camera,
        [100, 100],
        [
          [0, 0, 6],
          [0, 0, 7],
        ],
        0.01,
      ),
    ).toBeNull();
  });
});
