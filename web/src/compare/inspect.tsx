// Numbers under the pointer, and the histogram of the picture.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { isTyping } from "../keys";
import { numbers, type Store, size, view } from "../store";
import { layer, valueAt } from "./layers";
import { at, BARS, type Histogram, histogram, luminance } from "./linear";
import { errorMap, fittedReference, metric, reference } from "./state";

export const inspecting = signal(false);
export const showsHistogram = signal(false);
/** The pixel under the pointer. */
const pointer = signal<[number, number] | null>(null);

const short = (value: number): string =>
  value === 0 ? "0" : Math.abs(value) < 1e-3 ? value.toExponential(2) : value.toPrecision(4);

function Row(props: { name: string; values: number[] }): JSX.Element {
  return (
    <tr>
      <th>{props.name}</th>
      {props.values.map((v) => (
        <td>{short(v)}</td>
      ))}
    </tr>
  );
}

/** The values of the pixel under the pointer, linear. */
export function Readout({ store }: { store: Store }): JSX.Element | null {
  const marker = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const stage = marker.current!.closest(".stage") as HTMLElement;
    const move = (event: PointerEvent): void => {
      const box = stage.getBoundingClientRect();
      const ratio = size.value[0] / Math.max(1, box.width);
      pointer.value = [
        Math.floor((event.clientX - box.left) * ratio),
        Math.floor((event.clientY - box.top) * ratio),
      ];
    };
    const key = (event: KeyboardEvent): void => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
      if (event.key === "i") inspecting.value = !inspecting.value;
      if (event.key === "h") showsHistogram.value = !showsHistogram.value;
    };
    stage.addEventListener("pointermove", move);
    stage.addEventListener("pointerdown", move);
    window.addEventListener("keydown", key);
    return () => {
      stage.removeEventListener("pointermove", move);
      stage.removeEventListener("pointerdown", move);
      window.removeEventListener("keydown", key);
    };
  }, []);
  void numbers.value;
  const place = pointer.value;
  const isShown = inspecting.value || reference.value !== null || layer.value !== null;
  const { linear } = store.picture;
  const here = place && linear ? at(linear, ...place) : null;
  const there = here && fittedReference(linear!.size);
  const other = there && at(there, ...place!);
  const errors = errorMap.value;
  return (
    <div class="readout" ref={marker} hidden={!isShown || !place} data-testid="readout">
      {isShown && place && (
        <>
          <span>
            pixel {place[0]}, {place[1]}
          </span>
          {layer.value && <strong>{valueAt(layer.value, ...place)}</strong>}
          {here && !layer.value && (
            <table>
              <thead>
                <tr>
                  <th>linear</th>
                  <th>R</th>
                  <th>G</th>
                  <th>B</th>
                  <th>Y</th>
                </tr>
              </thead>
              <tbody>
                <Row name="picture" values={[...here, luminance(...here)]} />
                {other && <Row name="reference" values={[...other, luminance(...other)]} />}
                {other && (
                  <Row
                    name="difference"
                    values={[
                      ...here.map((v, i) => v - other[i]),
                      luminance(...here) - luminance(...other),
                    ]}
                  />
                )}
              </tbody>
            </table>
          )}
          {!here && !layer.value && <span class="quiet">numbers follow when the view rests</span>}
          {here && errors && (
            <span>
              {metric.value === "flip" ? "FLIP" : metric.value} error{" "}
              {short(errors.values[place[1] * errors.size[0] + place[0]] ?? NaN)}
            </span>
          )}
        </>
      )}
    </div>
  );
}

const isLogarithmic = signal(true);
/** White of a linear histogram, and the end of a logarithmic one, in linear light. */
const ENDS = { linear: 1, logarithmic: 64 };
const CHANNELS = ["red", "green", "blue", "luminance"] as const;

function outline(counts: Uint32Array, most: number): string {
  const scale = (count: number): number => 60 - (56 * Math.log1p(count)) / Math.log1p(most);
  const bars = Array.from(counts, (count, i) => `L${i},${scale(count)}L${i + 1},${scale(count)}`);
  return `M0,60${bars.join("")}L${BARS},60`;
}

/** Counts of the picture's values, by channel. */
export function HistogramPalette({ store }: { store: Store }): JSX.Element | null {
  const found = useRef<Histogram | null>(null);
  // Another picture has other counts.
  void numbers.value;
  if (!showsHistogram.value) return null;
  const { linear } = store.picture;
  const kind = isLogarithmic.value ? "logarithmic" : "linear";
  if (linear) found.current = histogram(linear, isLogarithmic.value, ENDS[kind]);
  const now = found.current;
  const other = linear && fittedReference(linear.size);
  const before = other && histogram(other, isLogarithmic.value, ENDS[kind]);
  const most = Math.max(1, ...(now?.counts ?? []).flatMap((c) => [...c]));
  // Layers of numbers are shown as shades of them.
  const of = view.value?.aov ?? "";
  const what = of ? "shades of the layer" : "linear light";
  const zero = now ? Math.round((-now.low / (now.high - now.low)) * BARS) : 0;
  return (
    <section class="palette" aria-label="histogram">
      <div class="row">
        <strong>{of ? `Histogram of ${of}, as shown` : "Histogram"}</strong>
        <button
          aria-pressed={isLogarithmic.value}
          onClick={() => (isLogarithmic.value = !isLogarithmic.value)}
        >
          Logarithmic
        </button>
        <button aria-label="close the histogram" onClick={() => (showsHistogram.value = false)}>
          ×
        </button>
      </div>
      {now ? (
        <svg
          class="histogram"
          viewBox={`0 0 ${BARS} 62`}
          preserveAspectRatio="none"
          role="img"
          aria-label="how many pixels have which value, by channel"
        >
          {isLogarithmic.value && <line class="one" x1={zero} x2={zero} y1="0" y2="60" />}
          {now.counts.map((counts, i) => (
            <path class={CHANNELS[i]} d={outline(counts, most)} />
          ))}
          {before && <path class="before" d={outline(before.counts[3], most)} />}
        </svg>
      ) : (
        <small class="quiet">follows when the view rests</small>
      )}
      {now && (
        <div class="ends">
          <span>{isLogarithmic.value ? `2^${now.low}` : "0"}</span>
          <small class="quiet">
            {isLogarithmic.value ? `${what}, by stops; the line is 1` : what}
          </small>
          <span>{isLogarithmic.value ? `2^${now.high}` : "1"}</span>
        </div>
      )}
    </section>
  );
}
