import { describe, expect, test } from "vitest";
import {
  apply,
  applyToVector,
  compose,
  IDENTITY,
  inverse,
  type Rows,
  translation,
  turnAbout,
} from "../src/affine";
import { after } from "../src/animation";
import { type Camera, oriented, project } from "../src/camera";
import { fromHex, toHex } from "../src/color";
import { inside, order } from "../src/form";
import { movedBy, niceStep } from "../src/gizmo";
import { newPlace } from "../src/light";
import { freshName } from "../src/names";
import { clamped, shown } from "../src/number";
import type { Form, PickedHit, Placement } from "../src/protocol.gen";
import { alongLine, onPlane, rayThrough } from "../src/ray";
import { followed, ring } from "../src/select";
import { isLight, isPicture } from "../src/send";
import { contents } from "../src/status";
import { length, sub, type Vec3 } from "../src/vec";

const near = (a: number[], b: number[]): void =>
  a.forEach((x, i) => {
    expect(x).toBeCloseTo(b[i]!, 9);
  });

describe("numbers and colours of forms", () => {
  test("a number is kept between its bounds, either of which may be missing", () => {
    expect([clamped(2, [0, 1]), clamped(-2, [0, null]), clamped(5, [null, null])]).toEqual([
      1, 0, 5,
    ]);
    expect(clamped(3)).toBe(3);
  });
  test("numbers are shown without the noise of single precision", () => {
    expect(shown(0.30000001192092896)).toBe("0.3");
  });
  test("a colour that is not touched keeps its bits", () => {
    const color = [0.5520001, 0.1230001, 3.75];
    expect(fromHex(toHex(color), color)).toEqual(color);
    const [red, green, blue] = fromHex(`#ff${toHex(color).slice(3)}`, color);
    expect([green, blue]).toEqual([0.1230001, 3.75]);
    expect(red).toBeCloseTo(3.75);
  });
  test("parameters are shown in the order of their declarations", () => {
    const field = (name: string): Form => ({
      name,
      kind: "number",
      range: null,
      limits: [null, null],
      default: null,
      is_textured: false,
      unit: "",
      doc: "",
      options: [],
      fields: [],
      tag: "",
      kinds: {},
      docs: {},
    });
    const form = {
      ...field(""),
      tag: "kind",
      kinds: { glass: [field("ior"), field("absorption")] },
    };
    const value = { absorption: 0, extra: 1, ior: 1.5, kind: "glass" };
    expect(order(form, value)).toEqual(["ior", "absorption", "extra", "kind"]);
    expect(inside(form, value, "ior")?.name).toBe("ior");
  });
});

describe("maps and rays of the gizmo", () => {
  const skew: Rows = [
    [2, 0.5, 0, 3],
    [0, 1, 0.25, -1],
    [0.5, 0, 4, 2],
  ];
  test("a map after its inverse changes nothing", () => {
    const both = compose(inverse(skew)!, skew);
    both.forEach((row, i) => {
      near(row, IDENTITY[i]!);
    });
    expect(inverse([skew[0], skew[0], skew[2]])).toBeNull();
  });
  test("a turn about an axis leaves its centre where it is", () => {
    const turn = turnAbout([1, 2, 3], [0, 1, 0], Math.PI / 2);
    near(apply(turn, [1, 2, 3]), [1, 2, 3]);
    near(apply(turn, [2, 2, 3]), [1, 2, 2]);
    near(applyToVector(translation([5, 5, 5]), [1, 0, 0]), [1, 0, 0]);
  });

  const camera: Camera = {
    name: "",
    eye: [0, 0, 10],
    towards: [0, 0, -1],
    up: [0, 1, 0],
    projection: { projection: "perspective", tan_half_fov: [null, 0.5] },
    aperture_radius: 0,
    focus_distance: 10,
    resolution: null,
  };
  const size: [number, number] = [200, 100];
  test("the ray of a pixel meets planes and lines where they are seen", () => {
    const ray = rayThrough(camera, [150, 50], size)!;
    near(onPlane(ray, [0, 0, 0], [0, 0, 1])!, [5, 0, 0]);
    expect(alongLine(ray, [0, 0, 0], [1, 0, 0])).toBeCloseTo(5);
    expect(onPlane(ray, [0, 0, 20], [0, 0, 1])).toBeNull();
    expect(
      rayThrough({ ...camera, projection: { projection: "panoramic" } }, [0, 0], size),
    ).toBeNull();
  });
  test("a drag along an arrow moves by what the pointer moved, and in steps with Ctrl", () => {
    const drag = (kind: "axis" | "plane" | "ring", axis: 0 | 1 | 2) => ({
      handle: { kind, axis },
      camera,
      scale: 5,
      from: [100, 50] as [number, number],
      target: { origin: [0, 0, 0] as Vec3 },
    });
    near(apply(movedBy(drag("axis", 0), [120, 50], false, size), [0, 0, 0]), [2, 0, 0]);
    near(apply(movedBy(drag("axis", 0), [124, 50], true, size), [0, 0, 0]), [2, 0, 0]);
    near(apply(movedBy(drag("plane", 2), [120, 40], false, size), [0, 0, 0]), [2, 1, 0]);
    const ringed = { ...drag("ring", 2), from: [150, 50] as [number, number] };
    near(apply(movedBy(ringed, [100, 0], false, size), [1, 0, 0]), [0, 1, 0]);
  });
  test("steps read well", () => {
    expect([niceStep(1), niceStep(3.7), niceStep(0.06), niceStep(900)]).toEqual([1, 2, 0.05, 500]);
  });
});

describe("new things", () => {
  test("a name that is taken gets a number", () => {
    expect(freshName("material", ["red", ""])).toBe("material");
    expect(freshName("material", ["material", "material 3"])).toBe("material 2");
    expect(freshName("material", ["material", "material 2"])).toBe("material 3");
  });
  test("a new light stands in the picture and before the subject, however it is seen", () => {
    const box: [Vec3, Vec3] = [
      [-1, 0, -1],
      [1, 3, 1],
    ];
    const size: [number, number] = [300, 200];
    for (const eye of [
      [0, 1.5, 9],
      [6, 8, 1],
      [0.1, 9, 0],
      [0, -3, 4],
      [0, 1.5, 2],
    ] as Vec3[]) {
      for (const target of [
        [0, 1.5, 0],
        [1, 2, 0],
        [20, 4, 5],
      ] as Vec3[]) {
        const camera = oriented(
          {
            name: "",
            eye,
            towards: [0, 0, -1],
            up: [0, 1, 0],
            projection: { projection: "perspective", tan_half_fov: [null, 0.3] },
            aperture_radius: 0,
            focus_distance: 1,
            resolution: null,
          },
          sub(target, eye),
          [0, 1, 0],
        );
        const { place, middle } = newPlace(camera, size, box, [0, 1, 0]);
        const at = project(camera, place, size)!;
        expect(at.x > 0 && at.x < size[0] && at.y > 0 && at.y < size[1]).toBe(true);
        expect(length(sub(place, middle))).toBeGreaterThan(0.01);
      }
    }
  });
  test("what was picked follows its place and its material", () => {
    const place = (x: number): Placement => ({
      node: 1,
      name: "box",
      depth: 2,
      world_from_parent: IDENTITY,
      parent_from_node: translation([x, 0, 0]),
      bounds: [
        [0, 0, 0],
        [1, 1, 1],
      ],
    });
    const hit = {
      position: [1, 1, 1],
      normal: [0, 0, 1],
      material: 3,
      material_name: "red",
      bounds: [
        [0, 0, 0],
        [1, 1, 1],
      ],
    } as unknown as PickedHit;
    const moved = followed(hit, place(0), place(2), null);
    expect(moved).toMatchObject({ position: [3, 1, 1], material: null, material_name: "" });
    expect(moved.bounds).toEqual([
      [2, 0, 0],
      [3, 1, 1],
    ]);
    expect(followed(hit, place(0), { ...place(0), bounds: null }, null).material).toBe(3);
  });
});

describe("what lies over the picture, and files", () => {
  test("shapes are counted beside triangles", () => {
    expect(contents({ triangles: 2, shapes: 5 })).toBe("2 triangles, 5 shapes");
    expect(contents({ triangles: 0, shapes: 1 })).toBe("1 shape");
    expect(contents({ triangles: 0, shapes: 0 })).toBe("0 triangles");
  });
  test("a ring is drawn around a mask and not in it", () => {
    const alpha = ring({ size: [5, 3], runs: [7, 1, 7] });
    expect(alpha[7]).toBe(0);
    expect([alpha[6], alpha[8], alpha[2], alpha[12]].every((a) => a === 255)).toBe(true);
    expect(alpha[0]).toBeLessThan(255);
  });
  test("an animation begins again at its end", () => {
    expect(after(1.5, 0.25, [1, 2])).toBe(1.75);
    expect(after(1.75, 0.5, [1, 2])).toBe(1.25);
    expect(after(3, 1, [2, 2])).toBe(2);
  });
  test("pictures with light are told from pictures with colours", () => {
    expect([isLight("a.HDR"), isLight("a.png"), isPicture("b.JPG"), isPicture("b.obj")]).toEqual([
      true,
      false,
      true,
      false,
    ]);
  });
});
