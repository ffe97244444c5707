import { describe, expect, it } from "vitest";
import { dolly, fieldOfView, frameBall, look, move, orbit, pixelAtPivot, preset, rigOf, withFieldOfView, type Camera, type Rig } from "../src/camera";
import { parseFrame } from "../src/connection";
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
const bounds: [Vec3, Vec3] = [[-1, -1, -1], [1, 1, 1]];
const rig = (): Rig => rigOf(camera, bounds, [0, 1, 0]);

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
    for (const direction of [[0, 0, -1], [0, -1, 0], [1, 0, 0], [0, 1, 0]] as Vec3[]) {
      const r = preset(rig(), direction, [0, 0, 0], 1, [200, 100]);
      expectUpright(r);
      expect(dot(r.camera.towards, direction)).toBeCloseTo(1, 9);
      const distance = length(r.camera.eye);
      expect(Math.asin(1 / distance)).toBeLessThan(Math.atan(0.5));
    }
    expect(frameBall(rig(), [3, 0, 0], 1, [100, 100]).pivot).toEqual([3, 0, 0]);
  });
  it("has the field of view it is given", () => {
    expect(fieldOfView(withFieldOfView(camera, 60), [4, 3])).toBeCloseTo(60, 9);
  });
});

describe("frames", () => {
  it("are read from their header", () => {
    const bytes = new ArrayBuffer(46);
    const view = new DataView(bytes);
    [1, 7, 3, 2, 1, 1, 16, 64].forEach((word, i) => view.setUint32(i * 4, word, true));
    view.setFloat32(32, 12.5, true);
    const frame = parseFrame(bytes)!;
    expect([frame.kind, frame.number, frame.seq, frame.samples, frame.wanted]).toEqual(["half", 7, 3, 16, 64]);
    expect([frame.milliseconds, frame.payload.byteLength]).toEqual([12.5, 6]);
    expect(parseFrame(new ArrayBuffer(3))).toBeNull();
  });
});

describe("display", () => {
  it("knows half floats", () => {
    expect([0x0000, 0x3c00, 0xc000, 0x7bff, 0x0001].map(halfToNumber)).toEqual([0, 1, -2, 65504, 2 ** -24]);
  });
  it("has white, grey and black where they belong", () => {
    const out = new Uint8ClampedArray(12);
    const halves = Uint16Array.from([0x3c00, 0x3c00, 0x3c00, 0x31c3, 0x31c3, 0x31c3, 0, 0x7e00, 0xfc00]);
    toDisplay(halves, out, { exposure: 0, tonemap: "none", srgb: true });
    expect([...out.subarray(0, 4)]).toEqual([255, 255, 255, 255]);
    expect(out[4]).toBe(118);
    expect([...out.subarray(8, 11)]).toEqual([0, 0, 0]);
  });
  it("maps tones as the server does", () => {
    // Values of the server's tests: white is 0.619 linear in ACES, and 0.783 on a display of gamma 2.2 in AgX.
    const out = new Uint8ClampedArray(4);
    const white = Uint16Array.from([0x3c00, 0x3c00, 0x3c00]);
    toDisplay(white, out, { exposure: 0, tonemap: "aces", srgb: false });
    expect(out[1]! / 255).toBeCloseTo(0.619, 2);
    toDisplay(white, out, { exposure: 0, tonemap: "agx", srgb: false });
    expect((out[1]! / 255) ** (1 / 2.2)).toBeCloseTo(0.783, 2);
  });
});
