// Lights of the scene: the chosen one, where a new one is put, and how one is removed.

import { signal } from "@preact/signals";
import { type Box, type Camera, depthOf, project, type Size } from "./camera";
import type { Fields, Json } from "./form";
import { PLACES } from "./gizmo";
import { choices, type Store, scene } from "./store";
import { tool, use } from "./tool";
import { add, cross, length, mul, normalize, sub, type Vec3 } from "./vec";

/** Names of amounts of light in the declarations of lights. */
const LIGHT = ["intensity", "emission"];
/** A new light is at most so far from the middle of the picture: a share of the way to its edge. */
const WITHIN = 0.8;

/** The light that was chosen. */
export const chosenLight = signal<number | null>(null);
/** True while the section of the lights is open, so that their marks are shown. */
export const showsLights = signal(false);

/** Chooses a light, and shows its parameters. */
export function chooseLight(index: number): void {
  chosenLight.value = index;
  showsLights.value = true;
}

/** Removes a light; undoing brings it back. */
export function removeLight(store: Store, index: number): void {
  if (tool.value?.name === `Move light ${index}`) use(null);
  chosenLight.value = null;
  store.edit(`light.${index}`, null);
}

/** Where a light is; `null` for one without a place. */
export function placeOf(light: Fields): Vec3 | null {
  const name = PLACES.find((place) => place in light);
  return name ? (light[name] as unknown as Vec3) : null;
}

/**
 * A place for a light, and the point that it shines at: above the subject, on the side of the
 * camera, and inside of the picture.
 */
export function newPlace(
  camera: Camera,
  size: Size,
  subject: Box,
  up: Vec3,
): { place: Vec3; middle: Vec3; radius: number } {
  const [low, high] = subject;
  const radius = length(sub(high, low)) / 2 || 1;
  const isSeen = (point: Vec3, within: number): boolean => {
    const at = project(camera, point, size);
    if (!at) return false;
    const away = [at.x / size[0], at.y / size[1]].map((share) => Math.abs(2 * share - 1));
    return Math.max(...away) <= within;
  };
  let middle = mul(add(low, high), 0.5);
  // Who looks elsewhere puts it there.
  const depth = Math.max(depthOf(camera, middle), radius);
  if (!isSeen(middle, 1)) middle = add(camera.eye, mul(camera.towards, depth));
  const towardsEye = sub(camera.eye, middle);
  const above = normalize(add(mul(up, 1.2), normalize(towardsEye)), up);
  for (let share = 1.4; share > 0.02; share *= 0.85) {
    const place = add(middle, mul(above, radius * share));
    const isBefore = depthOf(camera, place) > 0.05 * length(towardsEye);
    if (isBefore && isSeen(place, WITHIN)) return { place, middle, radius };
  }
  // Before the subject it is seen where the subject is.
  return { place: add(middle, mul(towardsEye, 0.5)), middle, radius };
}

/** Values rounded for people to read. */
const rounded = (v: number[]): number[] => v.map((x) => Number(x.toPrecision(4)));

/**
 * A light of a kind: what a light before it had and both have; else before the subject and above
 * it, and as bright there as daylight through a window.
 */
export function lightOf(kind: string, before: Fields | null, store: Store): Fields {
  const next = { ...(choices.value!.examples.light![kind] as Fields) };
  const up = scene.value!.up as Vec3;
  const subject = scene.value!.subject as Box;
  const { place, middle, radius } = newPlace(store.rig!.camera, store.size, subject, up);
  const down = sub(middle, place);
  const distance = length(down);
  const side: Vec3 = Math.abs(up[0]) > 0.9 ? [0, 0, 1] : [1, 0, 0];
  const across = normalize(cross(down, side));
  const own: Record<string, Json> = {
    direction: rounded(normalize(down)),
    normal: rounded(normalize(down)),
    irradiance: [3, 3, 3],
    radius: Number((radius * 0.25).toPrecision(3)),
    lengths: rounded([radius * 0.6, radius * 0.6]),
    // The side that emits is that of the product of the axes.
    axes: [rounded(across), rounded(normalize(cross(normalize(down), across)))],
  };
  for (const name of PLACES) own[name] = rounded(place);
  const power = Number((4 * distance * distance).toPrecision(3));
  for (const name of LIGHT) own[name] = [power, power, power];
  for (const [name, value] of Object.entries(own)) {
    if (name in next) next[name] = value;
  }
  const old = before ?? {};
  const ofOld = (names: string[]): Json | undefined =>
    names.map((name) => old[name]).find((value) => Array.isArray(value));
  for (const names of [PLACES, LIGHT, ["direction", "normal"], ["axes"], ["attenuation"]]) {
    const [value, name] = [ofOld(names), names.find((n) => n in next)];
    if (value !== undefined && name) next[name] = value;
  }
  return next;
}
