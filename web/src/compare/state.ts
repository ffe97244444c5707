// What the picture is compared with, and how.

import { signal } from "@preact/signals";
import { latest } from "../latest";
import { busy, exposure, numbers, type Store, tonemap, view } from "../store";
import { toDisplay } from "../tonemap";
import { paint } from "./colormap";
import { errors, type Linear, type Metric, mean, NUMBERS, resized } from "./linear";
import { type Comparison, decode, difference } from "./server";

export interface Reference {
  name: string;
  /** Linear values in the reference's own size. */
  linear: Linear;
}

export const MODES = [
  { mode: "wipe", name: "Wipe" },
  { mode: "flip", name: "Flip" },
  { mode: "difference", name: "Difference" },
] as const;
export type Mode = (typeof MODES)[number]["mode"];

export const reference = signal<Reference | null>(null);
export const mode = signal<Mode>("wipe");
export const metric = signal<Metric>("flip");
/** Where the wipe is, percent from the left. */
export const split = signal(50);
/** True while the reference is shown in place of the picture. */
export const isFlipped = signal(false);
/** The error that has the brightest colour, apart from FLIP, where it is 1. */
export const BRIGHTEST = 0.5;
export const brightest = signal(BRIGHTEST);
/** The mean error, as a line of text. */
export const summary = signal("");

/** What is said while the picture that is to be kept still moves. */
const WAITING = "keeping the picture as soon as it rests";

/**
 * Keeps the present picture as the reference, or ends the comparison. While the picture moves, the
 * one at rest is kept as soon as it is there; asked again meanwhile, none is.
 */
export async function toggleCompare(store: Store): Promise<void> {
  if (reference.value || busy.value === WAITING) {
    reference.value = null;
    busy.value = "";
    return;
  }
  if (store.isMoving) {
    busy.value = WAITING;
    await store.heard();
    while (busy.value === WAITING && store.isMoving)
      await new Promise((resolve) => window.setTimeout(resolve, 50));
    if (busy.value !== WAITING) return;
    busy.value = "";
  }
  const { samples } = numbers.value;
  const name = `kept, ${samples} sample${samples === 1 ? "" : "s"}`;
  reference.value = { name, linear: store.picture.linear! };
}

/** Compares with a picture file. */
export async function compareWith(store: Store, file: File): Promise<void> {
  try {
    reference.value = { name: file.name, linear: await decode(file) };
  } catch (problem) {
    store.notice((problem as Error).message);
  }
}

/** The reference in the size of the picture, kept for the next time. */
let fitted: { of: Linear; to: Linear } | null = null;

/** The reference in the size of the picture; `null` if there is none. */
export function fittedReference(size: [number, number]): Linear | null {
  const of = reference.value?.linear;
  if (!of) return null;
  const [w, h] = fitted?.to.size ?? [0, 0];
  if (fitted?.of !== of || w !== size[0] || h !== size[1]) fitted = { of, to: resized(of, size) };
  return fitted.to;
}

function put(canvas: HTMLCanvasElement, image: ImageData): void {
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext("2d")!.putImageData(image, 0, 0);
}

/** What was drawn last as the reference. */
let drawn: unknown[] = [];

/** Draws the reference as the picture is shown: same size, exposure and tone map. */
export function drawReference(canvas: HTMLCanvasElement, size: [number, number]): void {
  const wanted = [canvas, reference.value, ...size, exposure.value, tonemap.value];
  if (wanted.every((value, i) => value === drawn[i])) return;
  drawn = wanted;
  const linear = fittedReference(size);
  if (linear) {
    const image = new ImageData(...linear.size);
    toDisplay(linear.halves, image.data, {
      exposure: exposure.value,
      tonemap: tonemap.value,
      srgb: view.value?.srgb ?? true,
    });
    put(canvas, image);
  }
}

/** Errors of each pixel, for the number under the pointer. */
export const errorMap = signal<{ values: Float32Array; size: [number, number] } | null>(null);

const short = (value: number): string => Number(value.toPrecision(4)).toString();

function facts({ flip, mse, rel_mse, psnr }: Comparison): string {
  const ratio = psnr === null ? "equal" : `PSNR ${psnr.toFixed(2)} dB`;
  return `mean FLIP ${short(flip)} · MSE ${short(mse)} · relative MSE ${short(rel_mse)} · ${ratio}`;
}

function putErrors(canvas: HTMLCanvasElement, values: Float32Array, size: [number, number]): void {
  if (values.length !== size[0] * size[1]) return;
  errorMap.value = { values, size };
  const image = new ImageData(...size);
  paint(values, [0, metric.peek() === "flip" ? 1 : brightest.peek()], "magma", -1, image.data);
  put(canvas, image);
}

/** What the server is asked to compare. */
let wanted: { canvas: HTMLCanvasElement; test: Linear; other: Linear } | null = null;

const askServer = latest(async () => {
  const now = wanted;
  if (!now) return;
  try {
    const display = { exposure: exposure.peek(), tonemap: tonemap.peek() };
    const { comparison, errors } = await difference(now.other, display);
    if (wanted !== now) return;
    const values = Float32Array.from(errors, (bits) => NUMBERS[bits]);
    putErrors(now.canvas, values, now.test.size);
    summary.value = facts(comparison);
  } catch (problem) {
    summary.value = (problem as Error).message;
  }
});

/** Draws the difference between the picture at rest and the reference. */
export function drawDifference(canvas: HTMLCanvasElement, test: Linear | null): void {
  wanted = null;
  // What is there from another mode is no difference.
  if (drawn.length > 0) canvas.width = 1;
  drawn = [];
  const other = test && fittedReference(test.size);
  if (!test || !other) summary.value = "the picture moves; its difference follows when it rests";
  else if (metric.value === "flip") {
    summary.value = summary.peek() || "comparing …";
    wanted = { canvas, test, other };
    askServer();
  } else {
    const values = errors(test, other, metric.value);
    putErrors(canvas, values, test.size);
    summary.value = `mean ${metric.value} error ${short(mean(values))}`;
  }
}
