// Heat maps of what each pixel costs, for every acceleration structure side by side, on one scale.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { useDismiss } from "./dismiss";
import { host } from "./host";
import { choices, costs, view } from "./store";

/** Width of a map in pixels. */
const WIDTH = 320;

export interface CostMap {
  name: string;
  size: [number, number];
  /** By pixel: nodes and cells gone through, primitives tested. */
  counts: Uint32Array;
}

const MEASURES: Record<string, (nodes: number, tests: number) => number> = {
  "nodes and tests": (nodes, tests) => nodes + tests,
  "nodes and cells": (nodes) => nodes,
  "primitives tested": (_, tests) => tests,
};

/** Reads what the server sends. */
export function parseCosts(name: string, buffer: ArrayBuffer): CostMap {
  const words = new Uint32Array(buffer);
  return { name, size: [words[0], words[1]], counts: words.subarray(2) };
}

/**
 * From black over violet and orange to pale yellow: brighter is more, for any eyes. Smith's and van
 * der Walt's inferno, in five steps.
 */
const RAMP = [
  [0, 0, 4],
  [87, 16, 110],
  [188, 55, 84],
  [249, 142, 9],
  [252, 255, 164],
];

export function heat(share: number): [number, number, number] {
  const x = Math.max(0, Math.min(0.9999, share)) * (RAMP.length - 1);
  const [a, b] = [RAMP[Math.floor(x)], RAMP[Math.floor(x) + 1]];
  const mix = (i: number): number => Math.round(a[i] + (b[i] - a[i]) * (x % 1));
  return [mix(0), mix(1), mix(2)];
}

/** Mean of a measure over a map, and its value in nearly the dearest pixel. */
export function statistics(
  map: CostMap,
  measure: (nodes: number, tests: number) => number,
): { mean: number; high: number } {
  const values = Array.from({ length: map.counts.length / 2 }, (_, i) =>
    measure(map.counts[2 * i], map.counts[2 * i + 1]),
  );
  values.sort((a, b) => a - b);
  const mean = values.reduce((sum, v) => sum + v, 0) / Math.max(1, values.length);
  return { mean, high: values[Math.floor(values.length * 0.99)] ?? 0 };
}

function Heat(props: {
  map: CostMap;
  measure: (nodes: number, tests: number) => number;
  low: number;
  most: number;
}): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { map, measure, low, most } = props;
  const { mean, high } = statistics(map, measure);
  useEffect(() => {
    const element = canvas.current!;
    [element.width, element.height] = map.size;
    const image = new ImageData(map.size[0], map.size[1]);
    const [from, to] = [Math.log(Math.max(1, low)), Math.log(Math.max(2, most))];
    for (let i = 0; i < map.size[0] * map.size[1]; i++) {
      const value = measure(map.counts[2 * i], map.counts[2 * i + 1]);
      image.data.set(
        [...heat((Math.log(Math.max(1, value)) - from) / Math.max(1e-6, to - from)), 255],
        4 * i,
      );
    }
    element.getContext("2d")!.putImageData(image, 0, 0);
  }, [map, measure, low, most]);
  const number = (x: number): string => Number(x.toPrecision(3)).toLocaleString("en");
  return (
    <figure class="trace">
      <figcaption>
        <strong>{map.name}</strong>
        <span class="quiet">
          mean {number(mean)}, dearest {number(high)}
        </span>
      </figcaption>
      <canvas
        ref={canvas}
        class="heat"
        role="img"
        aria-label={`${map.name}: on the average ${number(mean)} a pixel`}
      />
    </figure>
  );
}

export function Costs(): JSX.Element {
  const maps = useSignal<CostMap[]>([]);
  const failed = useSignal("");
  const measure = useSignal("nodes and tests");
  const command = view.value?.command;
  useDismiss(true, () => (costs.value = false), { covers: true });
  useEffect(() => {
    const abort = new AbortController();
    const ask = async (): Promise<void> => {
      maps.value = [];
      failed.value = "";
      for (const name of choices.value?.accelerators ?? []) {
        const response = await host.ask(`cost?structure=${name}&width=${WIDTH}`, {
          signal: abort.signal,
        });
        if (!response.ok) {
          failed.value = (await response.text()).trim();
          return;
        }
        maps.value = [...maps.value, parseCosts(name, await response.arrayBuffer())];
      }
    };
    ask().catch(() => {});
    return () => abort.abort();
  }, [command]);
  const of = MEASURES[measure.value];
  const highs = maps.value.map((m) => statistics(m, of).high);
  const [low, most] = [1, Math.max(2, ...highs)];
  const missing = (choices.value?.accelerators.length ?? 0) - maps.value.length;
  return (
    <div class="explain" role="dialog" aria-label="acceleration structures compared">
      <header>
        <h2>What each pixel costs</h2>
        <select
          aria-label="measure"
          value={measure.value}
          onChange={(e) => (measure.value = e.currentTarget.value)}
        >
          {Object.keys(MEASURES).map((name) => (
            <option>{name}</option>
          ))}
        </select>
        <span class="scale" aria-hidden="true" />
        <span class="quiet">
          {low} to {Number(most.toPrecision(3)).toLocaleString("en")} a camera ray, logarithmic
        </span>
        {missing > 0 && !failed.value && <span role="status">building {missing} more …</span>}
        {failed.value && <span role="status">{failed.value}</span>}
        <span class="space" />
        <button onClick={() => (costs.value = false)}>Close</button>
      </header>
      <div class="traces maps">
        {maps.value.map((map) => (
          <Heat key={map.name} map={map} measure={of} low={low} most={most} />
        ))}
      </div>
    </div>
  );
}
