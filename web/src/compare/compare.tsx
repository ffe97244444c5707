// Comparing the picture with a reference: the reference over it, and the bar that says how.

import { useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { isTyping } from "../keys";
import { NumberInput } from "../number";
import { exposure, numbers, type Store, tonemap } from "../store";
import { gradient } from "./colormap";
import { METRICS, type Metric } from "./linear";
import {
  BRIGHTEST,
  brightest,
  drawDifference,
  drawReference,
  errorMap,
  isFlipped,
  MODES,
  metric,
  mode,
  reference,
  split,
  summary,
  toggleCompare,
} from "./state";

export function Compare({ store }: { store: Store }): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const now = reference.value;
  useSignalEffect(() => {
    const { linear, canvas: shown } = store.picture;
    // These are what the drawing depends on.
    void [numbers.value, exposure.value, tonemap.value, metric.value, brightest.value];
    if (!canvas.current || !reference.value) return;
    errorMap.value = null;
    if (mode.value === "difference" && !isFlipped.value) drawDifference(canvas.current, linear);
    else {
      summary.value = "";
      drawReference(canvas.current, linear?.size ?? [shown.width, shown.height]);
    }
  });
  useEffect(() => {
    const key = (event: KeyboardEvent): void => {
      if (event.key !== "b" || event.ctrlKey || event.metaKey || isTyping(event)) return;
      isFlipped.value = event.type === "keydown" && reference.value !== null;
    };
    window.addEventListener("keydown", key);
    window.addEventListener("keyup", key);
    return () => {
      window.removeEventListener("keydown", key);
      window.removeEventListener("keyup", key);
    };
  }, []);
  const isDifference = mode.value === "difference" && store.picture.linear !== null;
  const isShown = now !== null && (isFlipped.value || mode.value === "wipe" || isDifference);
  const isWiped = now !== null && mode.value === "wipe" && !isFlipped.value;
  return (
    <>
      <canvas
        ref={canvas}
        class="picture reference compared"
        style={{
          display: isShown ? "block" : "none",
          clipPath: isWiped ? `inset(0 ${100 - split.value}% 0 0)` : "none",
        }}
      />
      {isWiped && (
        <>
          <i class="wipe" style={{ left: `${split.value}%` }} />
          <input
            class="split"
            type="range"
            min="0"
            max="100"
            step="0.1"
            value={split.value}
            aria-label="reference on the left, picture on the right"
            onPointerDown={(e) => e.stopPropagation()}
            onInput={(e) => (split.value = Number(e.currentTarget.value))}
          />
        </>
      )}
    </>
  );
}

/** The bar of the comparison. */
export function ComparePalette({ store }: { store: Store }): JSX.Element | null {
  const now = reference.value;
  if (!now) return null;
  const [width, height] = now.linear.size;
  const size = store.picture.linear?.size ?? store.picture.pictureSize;
  const isScaled = width !== size[0] || height !== size[1];
  return (
    <section class="palette" aria-label="comparison">
      <div class="row">
        <strong class="name" title={now.name}>
          {now.name}
        </strong>
        {isScaled && (
          <small class="quiet">
            {width} × {height}, scaled
          </small>
        )}
        <button aria-label="end the comparison" onClick={() => void toggleCompare(store)}>
          ×
        </button>
      </div>
      <fieldset class="row" aria-label="how it is compared">
        {MODES.map((m) => (
          <button
            aria-pressed={mode.value === m.mode}
            onClick={() => {
              mode.value = m.mode;
              isFlipped.value = false;
            }}
          >
            {m.name}
          </button>
        ))}
        {mode.value === "flip" && (
          <button
            aria-pressed={isFlipped.value}
            title="Show the reference (hold B)"
            onClick={() => (isFlipped.value = !isFlipped.value)}
          >
            {isFlipped.value ? "Reference" : "Picture"}
          </button>
        )}
        {mode.value === "difference" && (
          <select
            aria-label="measure of the difference"
            value={metric.value}
            onChange={(e) => (metric.value = e.currentTarget.value as Metric)}
          >
            {METRICS.map((m) => (
              <option value={m.metric}>{m.name}</option>
            ))}
          </select>
        )}
      </fieldset>
      {mode.value === "difference" && (
        <>
          <div class="ends">
            <span>0</span>
            <i style={{ background: gradient("magma") }} />
            {metric.value === "flip" ? (
              <span>1</span>
            ) : (
              <NumberInput
                label="error of the brightest colour"
                value={brightest.value}
                fallback={BRIGHTEST}
                limits={[1e-9, null]}
                change={(value) => {
                  brightest.value = value ?? BRIGHTEST;
                }}
              />
            )}
          </div>
          <small role="status" data-testid="difference">
            {summary.value}
          </small>
        </>
      )}
    </section>
  );
}
