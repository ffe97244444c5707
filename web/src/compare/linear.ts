// Pictures of linear 16-bit floats, and numbers from them: pure functions.

import { halfToNumber } from "../tonemap";

/** Red, green, blue of each pixel as the bits of 16-bit floats, row by row from the top. */
export interface Linear {
  halves: Uint16Array;
  size: [number, number];
}

/** The number for all bits of a 16-bit float. */
export const NUMBERS = Float32Array.from({ length: 65536 }, (_, bits) => halfToNumber(bits));

const single = new Float32Array(1);
const bitsOfSingle = new Uint32Array(single.buffer);

/** The bits of the 16-bit float nearest to a number. */
export function numberToHalf(value: number): number {
  single[0] = value;
  const bits = bitsOfSingle[0];
  const sign = (bits >>> 16) & 0x8000;
  const magnitude = bits & 0x7fffffff;
  if (magnitude > 0x7f800000) return sign | 0x7e00;
  if (magnitude >= 0x477ff000) return sign | 0x7c00;
  if (magnitude < 0x38800000) return sign | Math.round(Math.abs(single[0]) * 2 ** 24);
  // Half of the last bit is added, and one less if the result would be odd: round to even.
  return sign | ((magnitude - 0x38000000 + 0xfff + ((magnitude >>> 13) & 1)) >>> 13);
}

/** Relative luminance of linear Rec. 709 values. */
export const luminance = (r: number, g: number, b: number): number =>
  0.2126 * r + 0.7152 * g + 0.0722 * b;

/** The values of a pixel; `null` outside of the picture. */
export function at(picture: Linear, x: number, y: number): [number, number, number] | null {
  const [width, height] = picture.size;
  if (!(x >= 0 && y >= 0 && x < width && y < height)) return null;
  const i = 3 * (y * width + x);
  const value = (c: number): number => NUMBERS[picture.halves[i + c]];
  return [value(0), value(1), value(2)];
}

/** The weights with which each of `to` places takes from `from`: a tent as wide as a place. */
function weights(from: number, to: number): { first: number; weights: number[] }[] {
  const scale = from / to;
  const reach = Math.max(1, scale);
  return Array.from({ length: to }, (_, i) => {
    const middle = (i + 0.5) * scale - 0.5;
    const first = Math.max(0, Math.ceil(middle - reach));
    const last = Math.min(from - 1, Math.floor(middle + reach));
    const raw = Array.from({ length: last - first + 1 }, (_, k) =>
      Math.max(0, 1 - Math.abs(first + k - middle) / reach),
    );
    const sum = raw.reduce((a, b) => a + b, 0) || 1;
    return { first, weights: raw.map((w) => w / sum) };
  });
}

/** The picture in another size. */
export function resized(picture: Linear, size: [number, number]): Linear {
  const [[w, h], [width, height]] = [picture.size, size];
  if (w === width && h === height) return picture;
  const narrow = new Float32Array(3 * width * h);
  weights(w, width).forEach(({ first, weights: of }, x) => {
    for (let y = 0; y < h; y++)
      for (let c = 0; c < 3; c++) {
        let sum = 0;
        for (let k = 0; k < of.length; k++)
          sum += of[k] * NUMBERS[picture.halves[3 * (y * w + first + k) + c]];
        narrow[3 * (y * width + x) + c] = sum;
      }
  });
  const halves = new Uint16Array(3 * width * height);
  weights(h, height).forEach(({ first, weights: of }, y) => {
    for (let i = 0; i < 3 * width; i++) {
      let sum = 0;
      for (let k = 0; k < of.length; k++) sum += of[k] * narrow[3 * width * (first + k) + i];
      halves[3 * width * y + i] = numberToHalf(sum);
    }
  });
  return { halves, size };
}

export const METRICS = [
  { metric: "flip", name: "FLIP" },
  { metric: "absolute", name: "Absolute" },
  { metric: "relative", name: "Relative" },
] as const;
export type Metric = (typeof METRICS)[number]["metric"];

/** The constant in the relative error: for dark references the error is in effect absolute. */
const RELATIVE_EPSILON = 0.01;

/** The error of each pixel: the mean over its channels. Both pictures have one size. */
export function errors(test: Linear, reference: Linear, metric: Metric): Float32Array {
  const count = test.size[0] * test.size[1];
  const out = new Float32Array(count);
  for (let i = 0, a = 0; i < count; i++) {
    let sum = 0;
    for (let c = 0; c < 3; c++, a++) {
      const [x, y] = [NUMBERS[test.halves[a]], NUMBERS[reference.halves[a]]];
      const d = Math.abs(x - y);
      sum += metric === "relative" ? d / (Math.abs(y) + RELATIVE_EPSILON) : d;
    }
    out[i] = sum / 3;
  }
  return out;
}

export const mean = (values: Float32Array): number => {
  let sum = 0;
  let count = 0;
  for (const value of values)
    if (Number.isFinite(value)) {
      sum += value;
      count += 1;
    }
  return sum / Math.max(1, count);
};

/** Minimum and maximum of what is finite and not `nothing`; `null` if there is nothing. */
export function extent(values: Float32Array, nothing: number): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values)
    if (Number.isFinite(value) && value !== nothing) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  return low <= high ? [low, high] : null;
}

/** Counts of values by their place between two ends: linear, or by stops. */
export interface Histogram {
  low: number;
  high: number;
  /** Red, green, blue, luminance. */
  counts: [Uint32Array, Uint32Array, Uint32Array, Uint32Array];
}

/** Bars of a histogram. */
export const BARS = 128;
/** The darkest stop of a logarithmic histogram; what is darker is in the first bar. */
export const DARKEST = -12;

/** Counts the values of a picture; those over the high end are in the last bar. */
export function histogram(picture: Linear, isLogarithmic: boolean, high: number): Histogram {
  const [from, to] = isLogarithmic ? [DARKEST, Math.log2(high)] : [0, high];
  const bar = (value: number): number => {
    const x = isLogarithmic ? Math.log2(Math.max(value, 1e-30)) : value;
    return Math.max(0, Math.min(BARS - 1, Math.floor(((x - from) / (to - from)) * BARS)));
  };
  const barOf = Uint8Array.from(NUMBERS, (v) => (Number.isNaN(v) ? 0 : bar(v)));
  const fresh = (): Uint32Array => new Uint32Array(BARS);
  const counts: Histogram["counts"] = [fresh(), fresh(), fresh(), fresh()];
  const { halves } = picture;
  for (let i = 0; i < halves.length; i += 3) {
    for (let c = 0; c < 3; c++) counts[c][barOf[halves[i + c]]] += 1;
    const y = luminance(NUMBERS[halves[i]], NUMBERS[halves[i + 1]], NUMBERS[halves[i + 2]]);
    counts[3][bar(Number.isNaN(y) ? 0 : y)] += 1;
  }
  return { low: from, high: to, counts };
}
