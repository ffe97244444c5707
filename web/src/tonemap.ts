// From scene-linear half floats to display bytes, as the server does it (crates/formats/src/image/tonemap.rs).

export interface Display {
  exposure: number;
  tonemap: string;
  srgb: boolean;
}

/** The value of a 16-bit float. */
export function halfToNumber(bits: number): number {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 0x1f;
  const fraction = bits & 0x3ff;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 0x1f) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

const VALUES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const value = halfToNumber(bits);
  return Number.isNaN(value) ? 0 : Math.max(0, Math.min(65504, value));
});

export function linearToSrgb(x: number): number {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

type Matrix = readonly (readonly [number, number, number])[];

function multiply(m: Matrix, v: number[], out: number[]): void {
  for (let i = 0; i < 3; i++) out[i] = m[i]![0] * v[0]! + m[i]![1] * v[1]! + m[i]![2] * v[2]!;
}

/** Stephen Hill's fit of the ACES transforms. */
const ACES: [Matrix, (v: number) => number, Matrix] = [
  [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]],
  (v) => (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081),
  [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]],
];

const AGX_TERMS = [-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5];

/** Troy Sobotka's AgX with Benjamin Wrensch's polynomial. */
const AGX: [Matrix, (v: number) => number, Matrix] = [
  [
    [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
    [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
    [0.0423756549057051, 0.0784336, 0.879142973793104],
  ],
  (v) => {
    const x = (Math.max(-12.47393, Math.min(4.026069, Math.log2(Math.max(v, 1e-38)))) + 12.47393) / 16.499999;
    return AGX_TERMS.reduceRight((sum, c) => sum * x + c, 0);
  },
  [
    [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
    [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
    [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
  ],
];

const byte = (value: number, srgb: boolean): number => {
  const clamped = Math.max(0, Math.min(1, value));
  return Math.round((srgb ? linearToSrgb(clamped) : clamped) * 255);
};

/** Curves are looked up between these many points of the logarithm of the light. */
const STEPS = 4096;
const LOW = -20;
const HIGH = 20;

/** Fills `out` (RGBA) with the display values of half floats (RGB). */
export function toDisplay(halves: Uint16Array, out: Uint8ClampedArray, display: Display): void {
  const gain = 2 ** display.exposure;
  const pixels = halves.length / 3;
  const curves = display.tonemap === "aces" ? ACES : display.tonemap === "agx" ? AGX : null;
  if (!curves) {
    const table = new Uint8Array(65536);
    for (let i = 0; i < 65536; i++) table[i] = byte(VALUES[i]! * gain, display.srgb);
    for (let i = 0, a = 0, b = 0; i < pixels; i++, a += 3, b += 4) {
      out[b] = table[halves[a]!]!;
      out[b + 1] = table[halves[a + 1]!]!;
      out[b + 2] = table[halves[a + 2]!]!;
      out[b + 3] = 255;
    }
    return;
  }
  const [input, curve, output] = curves;
  const power = display.tonemap === "agx" ? 2.2 : 1;
  const table = Float32Array.from({ length: STEPS + 2 }, (_, i) => curve(2 ** (LOW + ((HIGH - LOW) * i) / STEPS)));
  const last = Uint8Array.from({ length: 4097 }, (_, i) => byte((i / 4096) ** power, display.srgb));
  const [v, w] = [[0, 0, 0], [0, 0, 0]];
  for (let i = 0, a = 0, b = 0; i < pixels; i++, a += 3, b += 4) {
    for (let c = 0; c < 3; c++) v[c] = Math.min(1e6, VALUES[halves[a + c]!]! * gain);
    multiply(input, v, w);
    for (let c = 0; c < 3; c++) {
      const x = ((Math.log2(Math.max(w[c]!, 1e-6)) - LOW) / (HIGH - LOW)) * STEPS;
      const at = Math.max(0, Math.min(STEPS, x));
      const low = Math.floor(at);
      v[c] = table[low]! + (table[low + 1]! - table[low]!) * (at - low);
    }
    multiply(output, v, w);
    for (let c = 0; c < 3; c++) out[b + c] = last[Math.round(Math.max(0, Math.min(1, w[c]!)) * 4096)]!;
    out[b + 3] = 255;
  }
}
