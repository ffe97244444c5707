// What the server answers about pictures and references.

import { parseFrame } from "../connection";
import { unpackHalves } from "../halves";
import { host } from "../host";
import type { Linear } from "./linear";

/** The facts and the bytes after them. */
function withFacts<T>(buffer: ArrayBuffer): { facts: T; bytes: ArrayBuffer } {
  const length = new DataView(buffer).getUint32(0, true);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  return { facts: JSON.parse(text) as T, bytes: buffer.slice(4 + length) };
}

/** Asks the server; an error is a message for the user. */
async function ask(query: string, body?: BodyInit): Promise<ArrayBuffer> {
  const response = await host.ask(query, body === undefined ? {} : { method: "POST", body });
  if (!response.ok) throw new Error((await response.text()).trim());
  return response.arrayBuffer();
}

/** Decodes a picture file of any format that Snell reads. */
export async function decode(file: File): Promise<Linear> {
  const frame = parseFrame(await ask(`reference?name=${encodeURIComponent(file.name)}`, file));
  if (!frame) throw new Error(`${file.name}: the server's answer is no picture`);
  return { halves: await unpackHalves(frame.payload, frame.size), size: frame.size };
}

/** The numbers of `snell compare`. */
export interface Comparison {
  flip: number;
  mse: number;
  rel_mse: number;
  psnr: number | null;
}

/** Compares the picture at rest with a reference of its size, as both are shown. */
export async function difference(
  reference: Linear,
  display: { exposure: number; tonemap: string },
): Promise<{ comparison: Comparison; errors: Uint16Array }> {
  const [width, height] = reference.size;
  const { exposure, tonemap } = display;
  const query = new URLSearchParams({
    width: String(width),
    height: String(height),
    exposure: String(exposure),
    tonemap,
  });
  const body = reference.halves as Uint16Array<ArrayBuffer>;
  const { facts, bytes } = withFacts<Comparison>(await ask(`difference?${query}`, body));
  return { comparison: facts, errors: new Uint16Array(bytes) };
}

export interface Layer {
  name: string;
  channels: string[];
  size: [number, number];
  /** The range of the first channel in pixels that surfaces fill; `null` if there are none. */
  range: [number, number] | null;
  values: Float32Array;
}

/** The exact values of a layer of the picture at rest; `null` while it is still to come. */
export async function layer(name: string): Promise<Layer | null> {
  const buffer = await ask(`layer?name=${encodeURIComponent(name)}`);
  if (buffer.byteLength === 0) return null;
  const { facts, bytes } = withFacts<Omit<Layer, "values">>(buffer);
  return { ...facts, values: new Float32Array(bytes) };
}

/** The edges that a camera sees: 255 on a line, 0 elsewhere; `null` while a scene is prepared. */
export async function edges(camera: unknown, size: [number, number]): Promise<Uint8Array | null> {
  const query = new URLSearchParams({
    camera: JSON.stringify(camera),
    width: String(size[0]),
    height: String(size[1]),
  });
  const mask = new Uint8Array(await ask(`edges?${query}`));
  return mask.length > 0 ? mask : null;
}
