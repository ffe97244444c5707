import { describe, expect, it } from "vitest";
import { isAddress, linkTo, parseLink } from "../src/alone/link";
import type { Camera } from "../src/camera";
import type { ViewInfo } from "../src/protocol.gen";

const camera = { eye: [1, 0.1, -2.5] } as unknown as Camera;

describe("links", () => {
  it("say again what they were made of", () => {
    const view = {
      integrator: "path",
      spp: 64,
      max_depth: 5,
      aov: "",
      accelerator: "bvh",
      settings: { clamp: "10" },
      exposure: -1.5,
      tonemap: "aces",
    } as unknown as ViewInfo;
    const hash = linkTo("https://example.org/a b.glb", camera, view);
    expect(hash.startsWith("#scene=https://example.org/a%20b.glb&integrator=path")).toBe(true);
    expect(parseLink(hash)).toEqual({
      link: {
        scene: "https://example.org/a b.glb",
        camera,
        integrator: "path",
        spp: 64,
        max_depth: 5,
        accelerator: "bvh",
        exposure: -1.5,
        tonemap: "aces",
        settings: { clamp: "10" },
      },
      problems: [],
    });
  });

  it("that are damaged say what is not understood", () => {
    const { link, problems } = parseLink("?scene=fog&spp=many&camera=%7B");
    expect(link).toEqual({ scene: "fog", settings: {} });
    expect(problems).toEqual(["spp is no number", "its camera is cut off"]);
    expect(parseLink("#spp=4").link).toBe(null);
    expect(parseLink("").link).toBe(null);
  });

  it("tell addresses from names of built-in scenes", () => {
    expect(["fog", "cornell-box"].some(isAddress)).toBe(false);
    expect(["https://a.org/x", "models/a.glb", "a.glb"].every(isAddress)).toBe(true);
  });
});
