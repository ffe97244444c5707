// Layers that are no colours: numbers in false colours with a legend, ids with their names.

import { signal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import { latest } from "../latest";
import { NumberInput } from "../number";
import { numbers, type Store, scene, view } from "../store";
import { COLORMAPS, type Colormap, gradient, paint } from "./colormap";
import { extent } from "./linear";
import { layer as ask, type Layer } from "./server";

/** The layer that is shown at rest, with its exact values. */
export const layer = signal<Layer | null>(null);
export const colormap = signal<Colormap>("turbo");
/** The ends of the colours; `null` for the least and the greatest value. */
const ends = signal<[number, number] | null>(null);

/** Milliseconds until a layer that is not there yet is asked for again. */
const RETRY = 200;

/** Numbers of the layer are ids, not amounts. */
export const isId = (of: Layer): boolean => of.channels[0] === "id";
/** What a layer has where nothing is hit. */
const nothing = (of: Layer): number => (isId(of) ? -1 : of.name === "facing" ? NaN : 0);
const isAmount = (of: Layer): boolean => of.channels.length === 1 && !isId(of);

/** The range of the pixels that surfaces fill: silhouettes are mixed with the background. */
const whole = (of: Layer): [number, number] => of.range ?? extent(of.values, nothing(of)) ?? [0, 1];
const range = (of: Layer): [number, number] => ends.value ?? whole(of);

const short = (value: number): string => Number(value.toPrecision(5)).toString();

/** What the layer has at a pixel, in words. */
export function valueAt(of: Layer, x: number, y: number): string {
  const [width, height] = of.size;
  if (!(x >= 0 && y >= 0 && x < width && y < height)) return "";
  const n = of.channels.length;
  const values = [...of.values.subarray(n * (y * width + x), n * (y * width + x) + n)];
  if (isId(of)) {
    if (values[0] < 0) return `${of.name}: nothing`;
    const isMaterial = of.name === "material-id";
    const name = isMaterial ? (scene.value?.materials[values[0]]?.name as string | undefined) : "";
    return `${of.name} ${values[0]}${name ? ` (${name})` : ""}`;
  }
  return `${of.name} ${values.map(short).join("  ")}`;
}

/** Asks for the values of the layer that is shown whenever another picture is at rest. */
export function LayerColors({ store }: { store: Store }): JSX.Element | null {
  const canvas = useRef<HTMLCanvasElement>(null);
  const read = useRef(
    latest(async () => {
      const name = view.peek()?.aov ?? "";
      if (name === "") return;
      const found = await ask(name).catch(() => null);
      if (view.peek()?.aov !== name || numbers.peek().wanted === 0) return;
      // The server's picture of the layer is still to come.
      if (!found) {
        window.setTimeout(read, RETRY);
        return;
      }
      if (layer.peek()?.name !== name) ends.value = null;
      layer.value = found;
    }),
  ).current;
  useSignalEffect(() => {
    const name = view.value?.aov ?? "";
    const { samples, wanted } = numbers.value;
    if (layer.peek()?.name !== name) layer.value = null;
    if (name === "" || wanted === 0 || !store.picture.linear) {
      layer.value = null;
      return;
    }
    // The first samples show what there is, and the last ones what it is exactly.
    if (samples === 1 || samples >= wanted || layer.peek()?.name !== name) read();
  });
  const now = layer.value;
  useSignalEffect(() => {
    const of = layer.value;
    if (!of || !isAmount(of) || !canvas.current) return;
    const image = new ImageData(...of.size);
    paint(of.values, range(of), colormap.value, nothing(of), image.data);
    [canvas.current.width, canvas.current.height] = of.size;
    canvas.current.getContext("2d")!.putImageData(image, 0, 0);
  });
  const isShown = now !== null && isAmount(now);
  return <canvas ref={canvas} class="picture reference" hidden={!isShown} />;
}

/** The legend of a layer of amounts. */
export function Legend(): JSX.Element | null {
  const of = layer.value;
  if (!of || !isAmount(of)) return null;
  const [low, high] = range(of);
  const end = (name: string, which: 0 | 1): JSX.Element => (
    <NumberInput
      label={`${name} end of the colours`}
      value={which === 0 ? low : high}
      fallback={whole(of)[which]}
      limits={which === 0 ? [null, high] : [low, null]}
      digits={5}
      change={(value) => {
        const next = which === 0 ? [value!, high] : [low, value!];
        ends.value = next as [number, number];
      }}
    />
  );
  return (
    <section class="palette" aria-label={`legend of ${of.name}`}>
      <div class="row">
        <strong>{of.name}</strong>
        <select
          aria-label="colour map"
          value={colormap.value}
          onChange={(e) => (colormap.value = e.currentTarget.value as Colormap)}
        >
          {COLORMAPS.map((map) => (
            <option value={map}>{map}</option>
          ))}
        </select>
        <button disabled={ends.value === null} onClick={() => (ends.value = null)}>
          Whole range
        </button>
      </div>
      <div class="ends">
        {end("lower", 0)}
        <i style={{ background: gradient(colormap.value) }} />
        {end("upper", 1)}
      </div>
    </section>
  );
}
