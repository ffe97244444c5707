// Colour maps: a number from 0 to 1 becomes a colour.

type Colour = [number, number, number];

/** Nine samples of matplotlib's colour maps (van der Walt, Smith; CC0), joined by lines. */
const STOPS: Record<"viridis" | "magma", Colour[]> = {
  viridis: [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
  ],
  magma: [
    [0, 0, 4],
    [28, 16, 68],
    [79, 18, 123],
    [129, 37, 129],
    [181, 54, 122],
    [229, 80, 100],
    [251, 135, 97],
    [254, 194, 135],
    [252, 253, 191],
  ],
};

/** Coefficients of the polynomials for Turbo by Anton Mikhailov and Ruofei Du (Apache 2.0). */
const TURBO = [
  [0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943],
  [0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604],
  [0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973],
];

export const COLORMAPS = ["turbo", "viridis", "magma"] as const;
export type Colormap = (typeof COLORMAPS)[number];

/** The colour of a share from 0 to 1, as bytes. */
export function colour(map: Colormap, share: number): Colour {
  const x = Math.max(0, Math.min(1, share));
  if (map === "turbo")
    return TURBO.map((terms) => {
      const value = terms.reduceRight((sum, term) => sum * x + term, 0);
      return Math.round(Math.max(0, Math.min(1, value)) * 255);
    }) as Colour;
  const stops = STOPS[map];
  const place = x * (stops.length - 1);
  const i = Math.min(stops.length - 2, Math.floor(place));
  const mix = (c: number): number =>
    Math.round(stops[i][c] + (stops[i + 1][c] - stops[i][c]) * (place - i));
  return [mix(0), mix(1), mix(2)];
}

/** Fills `out` (RGBA) with the colours of values between two ends; `nothing` is black. */
export function paint(
  values: Float32Array,
  [low, high]: [number, number],
  map: Colormap,
  nothing: number,
  out: Uint8ClampedArray,
): void {
  const table = Array.from({ length: 256 }, (_, i) => colour(map, i / 255));
  const scale = 255 / (high - low || 1);
  values.forEach((value, i) => {
    const share = Math.round(Math.max(0, Math.min(255, (value - low) * scale)));
    const isNothing = value === nothing || Number.isNaN(value);
    const [r, g, b] = isNothing ? [0, 0, 0] : table[share];
    out[4 * i] = r;
    out[4 * i + 1] = g;
    out[4 * i + 2] = b;
    out[4 * i + 3] = 255;
  });
}

/** A colour map as a gradient of CSS, from left to right. */
export function gradient(map: Colormap): string {
  const stops = Array.from({ length: 17 }, (_, i) => `rgb(${colour(map, i / 16).join(" ")})`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}
