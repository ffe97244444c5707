import { describe, expect, it } from "vitest";
import {
  aboveGround,
  type Camera,
  dolly,
  fieldOfView,
  frameBox,
  look,
  move,
  orbit,
  orbitAboveGround,
  pan,
  pixelAtPivot,
  pointAt,
  preset,
  project,
  type Rig,
  rigOf,
  toggleParallel,
  withCamera,
  withFieldOfView,
} from "../src/camera";
import { Parts, parseFrame } from "../src/connection";
import { heat, parseCosts, statistics } from "../src/costs";
import { css, plotted, short } from "../src/explain";
import { inside } from "../src/form";
import { unpackHalves } from "../src/halves";
import { type Form, HEADER_SIZE, PART_SIZE, type Report } from "../src/protocol.gen";
import { outline } from "../src/replay";
import { sunDirection, sunPosition } from "../src/sun";
import { halfToNumber, toDisplay } from "../src/tonemap";
import { dot, length, sub, type Vec3 } from "../src/vec";

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
  [-1, -1, -1],
  [1, 1, 1],
];
const rig = (): Rig => rigOf(camera, { subject: bounds, up: [0, 1, 0], ground: null });
const SIZE: [number, number] = [640, 400];
const parallel = (): Rig => toggleParallel(rig(), SIZE);

function expectUpright({ camera: c }: Rig): void {
  expect(length(c.towards)).toBeCloseTo(1, 12);
  expect(length(c.up)).toBeCloseTo(1, 12);
  expect(dot(c.towards, c.up)).toBeCloseTo(0, 12);
}

describe("camera", () => {
  it("turns about the pivot at the same distance", () => {
    let r = rig();
    for (let i = 0; i < 200; i++) {
      r = orbit(r, 0.1, 0.07);
      expectUpright(r);
      expect(length(sub(r.camera.eye, r.pivot))).toBeCloseTo(5, 9);
    }
  });
  it("turns what is shown with the hand: a drag down raises the camera", () => {
    expect(orbit(rig(), 0, 0.1).camera.eye[1]).toBeGreaterThan(0);
    expect(orbit(rig(), 0.1, 0).camera.eye[0]).toBeLessThan(0);
  });
  it("never goes over the pole", () => {
    let r = rig();
    for (let i = 0; i < 100; i++) r = orbit(r, 0, 0.5);
    expect(r.camera.up[1]).toBeGreaterThan(0);
    for (let i = 0; i < 200; i++) r = orbit(r, 0, -0.5);
    expect(r.camera.up[1]).toBeGreaterThan(0);
    expectUpright(r);
  });
  it("looks around from where it is", () => {
    const r = look(rig(), 0.4, 0.2);
    expect(r.camera.eye).toEqual(camera.eye);
    expect(r.camera.towards[0]).toBeGreaterThan(0);
    expect(r.camera.towards[1]).toBeLessThan(0);
    expectUpright(r);
  });
  it("moves a pixel by a pixel", () => {
    const unit = pixelAtPivot(rig(), [100, 100]);
    expect(unit).toBeCloseTo((5 * 2 * 0.5) / 100, 12);
    expect(move(rig(), unit, 0, 0).camera.eye[0]).toBeCloseTo(unit, 12);
  });
  it("comes closer by a factor", () => {
    expect(length(sub(dolly(rig(), 0.5).camera.eye, [0, 0, 0]))).toBeCloseTo(2.5, 12);
  });
  it("sees all of the scene after framing, from every side", () => {
    for (const direction of [
      [0, 0, -1],
      [0, -1, 0],
      [1, 0, 0],
      [0, 1, 0],
    ] as Vec3[]) {
      for (const size of [
        [200, 100],
        [390, 700],
      ] as [number, number][])
        for (const from of [rig(), parallel()]) {
          const r = preset(from, direction, bounds, size);
          expectUpright(r);
          expect(dot(r.camera.towards, direction)).toBeCloseTo(1, 9);
          let outermost = 0;
          for (let i = 0; i < 8; i++) {
            const corner: Vec3 = [i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1];
            const at = project(r.camera, corner, size)!;
            const beyond = [at.x / size[0], at.y / size[1]].map((s) => Math.abs(s * 2 - 1));
            outermost = Math.max(outermost, ...beyond);
          }
          expect(outermost).toBeCloseTo(0.9, 6);
        }
    }
    const aside: [Vec3, Vec3] = [
      [2, -1, -1],
      [4, 1, 1],
    ];
    expect(frameBox(rig(), aside, [100, 100]).pivot).toEqual([3, 0, 0]);
  });
  it("pans by what is under the hand, at any depth and in parallels", () => {
    for (const from of [rig(), parallel()])
      for (const depth of [undefined, 2, 9]) {
        const point = pointAt(from, [100, 300], SIZE, depth);
        const moved = pan(from, [100, 300], [250, 120], SIZE, depth);
        const at = project(moved.camera, point, SIZE)!;
        expect(at.x).toBeCloseTo(250, 6);
        expect(at.y).toBeCloseTo(120, 6);
      }
  });
  it("zooms to the pointer: what is there stays there", () => {
    for (const from of [rig(), parallel()])
      for (const factor of [0.5, 0.9, 1.7]) {
        const point = pointAt(from, [500, 90], SIZE, 3);
        const closer = dolly(from, factor, point);
        const at = project(closer.camera, point, SIZE)!;
        expect(at.x).toBeCloseTo(500, 6);
        expect(at.y).toBeCloseTo(90, 6);
        // The pivot stays in the middle of the picture.
        const middle = project(closer.camera, closer.pivot, SIZE)!;
        expect(middle.x).toBeCloseTo(320, 6);
      }
  });
  it("keeps the size of the subject in parallels and back", () => {
    const top: Vec3 = [0, 1, 0];
    const before = project(rig().camera, top, SIZE)!;
    const there = parallel();
    expect(there.camera.projection.projection).toBe("orthographic");
    expect(project(there.camera, top, SIZE)!.y).toBeCloseTo(before.y, 9);
    const back = toggleParallel(dolly(there, 0.5), SIZE, camera.projection);
    const twice = 200 - (200 - before.y) * 2;
    expect(project(back.camera, top, SIZE)!.y).toBeCloseTo(twice, 6);
  });
  it("is not taken under the ground by drags, but by flying", () => {
    const low: Camera = { ...camera, eye: [2, 1.7, 9.5], towards: [-0.2, 0.08, -0.97] };
    const around = { subject: bounds, up: [0, 1, 0] as Vec3, ground: 0 };
    let r = rigOf({ ...low, ...{ up: [0, 1, 0] } }, around);
    for (let i = 0; i < 50; i++) r = orbitAboveGround(r, 0.01, -0.02);
    expect(r.camera.eye[1]).toBeGreaterThan(0);
    expect(r.camera.eye[1]).toBeLessThan(0.5);
    for (let i = 0; i < 50; i++) r = aboveGround(r, move(r, 0, -0.1, 0));
    expect(r.camera.eye[1]).toBeGreaterThan(0);
    r = move(r, 0, -3, 0);
    expect(r.camera.eye[1]).toBeLessThan(0);
    expect(orbitAboveGround(r, 0.1, 0.1)).toEqual(orbit(r, 0.1, 0.1));
  });
  it("turns about the same point after a move is undone", () => {
    const turned = orbit(rig(), 0.4, 0.2);
    const back = withCamera(turned, camera);
    expect(length(sub(back.pivot, rig().pivot))).toBeLessThan(1e-9);
  });
  it("has the field of view it is given", () => {
    expect(fieldOfView(withFieldOfView(camera, 60), [4, 3])).toBeCloseTo(60, 9);
  });
});

describe("frames", () => {
  it("are read from their header", () => {
    const bytes = new ArrayBuffer(HEADER_SIZE + 6);
    const view = new DataView(bytes);
    [1, 7, 3, 2, 1, 1, 16, 64].forEach((word, i) => {
      view.setUint32(i * 4, word, true);
    });
    view.setFloat32(32, 12.5, true);
    const frame = parseFrame(bytes)!;
    expect([frame.kind, frame.number, frame.seq, frame.samples, frame.wanted]).toEqual([
      "half",
      7,
      3,
      16,
      64,
    ]);
    expect([frame.milliseconds, frame.payload.byteLength]).toEqual([12.5, 6]);
    expect(parseFrame(new ArrayBuffer(3))).toBeNull();
  });
  it("come in parts, and one may take the place of another", () => {
    const part = (frame: number, offset: number, total: number, ...bytes: number[]) => {
      const message = new Uint8Array(PART_SIZE + bytes.length);
      new Uint32Array(message.buffer, 0, 3).set([frame, offset, total]);
      message.set(bytes, PART_SIZE);
      return message.buffer;
    };
    const parts = new Parts();
    const whole = (message: ArrayBuffer) => {
      const joined = parts.add(message)?.whole;
      return joined ? [...new Uint8Array(joined)] : null;
    };
    expect(whole(part(1, 0, 3, 7, 8))).toBeNull();
    expect(whole(part(1, 2, 3, 9))).toEqual([7, 8, 9]);
    expect(whole(part(2, 0, 4, 1, 2))).toBeNull();
    expect(whole(part(3, 0, 1, 5))).toEqual([5]);
    expect(whole(part(2, 2, 4, 3, 4))).toBeNull();
    expect(parts.add(new ArrayBuffer(3))).toBeNull();
  });
  it("have every bit of every value", async () => {
    const planes = [0, 0, 0, 0x10, 0, 0xff, 0x78, 0x07, 0, 2, 0, 8];
    const packed = new Blob([Uint8Array.from(planes)]).stream();
    const deflated = packed.pipeThrough(new CompressionStream("deflate"));
    const bytes = await new Response(deflated).arrayBuffer();
    expect([...(await unpackHalves(bytes, [2, 1]))]).toEqual([
      0x3c00, 0x3c00, 0x3c00, 0x4000, 0x3800, 0x3c01,
    ]);
    await expect(unpackHalves(bytes, [3, 1])).rejects.toThrow();
  });
});

describe("display", () => {
  it("knows half floats", () => {
    expect([0x0000, 0x3c00, 0xc000, 0x7bff, 0x0001].map(halfToNumber)).toEqual([
      0,
      1,
      -2,
      65504,
      2 ** -24,
    ]);
  });
  it("has white, grey and black where they belong", () => {
    const out = new Uint8ClampedArray(12);
    const halves = Uint16Array.from([
      0x3c00, 0x3c00, 0x3c00, 0x31c3, 0x31c3, 0x31c3, 0, 0x7e00, 0xfc00,
    ]);
    toDisplay(halves, out, { exposure: 0, tonemap: "none", srgb: true });
    expect([...out.subarray(0, 4)]).toEqual([255, 255, 255, 255]);
    expect(out[4]).toBe(118);
    expect([...out.subarray(8, 11)]).toEqual([0, 0, 0]);
  });
  it("maps tones as the server does", () => {
    // Values of the server's tests: white is 0.619 linear in ACES, and 0.783 on a display of gamma
    // 2.2 in AgX.
    const out = new Uint8ClampedArray(4);
    const white = Uint16Array.from([0x3c00, 0x3c00, 0x3c00]);
    toDisplay(white, out, { exposure: 0, tonemap: "aces", srgb: false });
    expect(out[1] / 255).toBeCloseTo(0.619, 2);
    toDisplay(white, out, { exposure: 0, tonemap: "agx", srgb: false });
    expect((out[1] / 255) ** (1 / 2.2)).toBeCloseTo(0.783, 2);
  });
});

describe("explanations", () => {
  it("draws the outline of every kind of place", () => {
    const axes: [Vec3, Vec3, Vec3] = [
      [2, 0, 0],
      [0, 1, 0],
      [0, 0, 1],
    ];
    const center: Vec3 = [10, 0, 0];
    const box = outline({ kind: "box", center, axes });
    expect(box.length).toBe(12);
    expect(Math.min(...box.flat().map((p) => p[0]))).toBe(8);
    for (const p of outline({ kind: "ball", center, axes }).flat()) {
      expect(((p[0] - 10) / 2) ** 2 + p[1] ** 2 + p[2] ** 2).toBeCloseTo(1, 9);
    }
    expect(outline({ kind: "stretch", center, axes })).toEqual([
      [
        [8, 0, 0],
        [12, 0, 0],
      ],
    ]);
    expect(outline({ kind: "plane", center, axes })[0].length).toBe(5);
  });
  it("plots what is there and nothing that is no number", () => {
    const convergence = [1, 2, 4].map((samples) => ({
      samples,
      value: [samples, 1, 0],
      error: [0.5, 0, 0],
    }));
    const { lines, bands, ceiling } = plotted({ convergence } as unknown as Report);
    expect(lines.length).toBe(3);
    expect(ceiling).toBeGreaterThan(4);
    expect([...lines, ...bands].join()).not.toMatch(/NaN|Infinity/);
    expect(plotted({ convergence: [] } as unknown as Report).lines).toEqual([]);
  });
  it("writes numbers and colours shortly", () => {
    expect([0, 0.123456, 1e-7].map(short)).toEqual(["0", "0.1235", "1.00e-7"]);
    expect(css([2, 1, 0])).toBe("rgb(255 188 0)");
  });
});

describe("cost maps", () => {
  it("are read, measured and coloured", () => {
    const map = parseCosts("bvh", new Uint32Array([2, 1, 10, 4, 30, 8]).buffer);
    expect(map.size).toEqual([2, 1]);
    expect(statistics(map, (nodes) => nodes).mean).toBe(20);
    expect(statistics(map, (_, tests) => tests).high).toBe(8);
    expect(heat(0)).toEqual([0, 0, 4]);
    expect(heat(2)[0]).toBeGreaterThan(heat(0.3)[0]);
  });
});

describe("the sun", () => {
  it("goes there and back, whatever is up", () => {
    for (const up of [
      [0, 1, 0],
      [0, 0, 1],
    ] as Vec3[]) {
      for (const position of [
        { height: 30, side: 0 },
        { height: 60, side: 100 },
        { height: -5, side: -20 },
      ]) {
        const back = sunPosition(sunDirection(position, up), up);
        expect(back.height).toBeCloseTo(position.height, 9);
        expect(back.side).toBeCloseTo(position.side, 9);
      }
    }
    const [x, y, z] = sunDirection({ height: 0, side: 0 }, [0, 1, 0]);
    expect([x, y, z].map((v) => Math.round(v * 1e6) / 1e6 + 0)).toEqual([0, 0, 1]);
  });
});

describe("forms", () => {
  const form = (name: string, more: Partial<Form> = {}): Form => ({
    name,
    kind: "number",
    range: null,
    unit: "",
    doc: "",
    options: [],
    fields: [],
    tag: "",
    kinds: {},
    ...more,
  });
  it("find what stands inside of a group, of a value's variant, and of one by name", () => {
    const falloff = form("falloff", {
      tag: "falloff",
      kinds: { power: [form("cutoff")], step: [form("outer")] },
    });
    const spot = form("spot", { fields: [falloff] });
    expect(inside(spot, {}, "falloff")).toBe(falloff);
    expect(inside(falloff, { falloff: "power" }, "cutoff")?.name).toBe("cutoff");
    expect(inside(falloff, { falloff: "step" }, "cutoff")).toBeUndefined();
    const mapping = form("mapping", {
      kinds: { uv: [form("uv_set")], mask: [form("", { range: [0, 1] })] },
    });
    expect(inside(inside(mapping, {}, "uv"), {}, "uv_set")?.name).toBe("uv_set");
    expect(inside(mapping, {}, "mask")?.range).toEqual([0, 1]);
  });
});
