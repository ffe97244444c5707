// Colours of colour fields: sRGB bytes on the screen, linear numbers in the scene.

import { linearToSrgb } from "./tonemap";

/** The brightest channel, at least 1: colours of light are shown without their strength. */
export const strengthOf = (rgb: number[]): number => Math.max(1, ...rgb);

const byteOf = (linear: number): number => Math.round(linearToSrgb(Math.max(0, linear)) * 255);

/** The colour for a colour field, without its strength. */
export const toHex = (rgb: number[]): string => {
  const most = strengthOf(rgb);
  return `#${rgb
    .map((v) =>
      byteOf(v / most)
        .toString(16)
        .padStart(2, "0"),
    )
    .join("")}`;
};

/**
 * The linear colour of a colour field. Channels that show the same byte as before keep their bits.
 */
export const fromHex = (hex: string, before: number[]): number[] => {
  const most = strengthOf(before);
  return [1, 3, 5].map((at, i) => {
    const byte = parseInt(hex.slice(at, at + 2), 16);
    if (byte === byteOf(before[i]! / most)) return before[i]!;
    const s = byte / 255;
    const linear = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    return Number((linear * most).toPrecision(4));
  });
};
