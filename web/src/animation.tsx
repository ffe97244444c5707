// The bar under the picture of a scene that moves: play, scrub, choose, speed.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useEffect } from "preact/hooks";
import { NumberInput } from "./number";
import { type Store, scene, steers } from "./store";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

/** The time after a step of playing, which begins again at the end. */
export function after(time: number, step: number, [start, end]: [number, number]): number {
  const length = end - start;
  if (!(length > 0)) return start;
  const since = (time + step - start) % length;
  return start + (since < 0 ? since + length : since);
}

export function AnimationBar({ store }: { store: Store }): JSX.Element | null {
  const playing = useSignal(false);
  const speed = useSignal(1);
  const time = useSignal<number | null>(null);
  const clip = useSignal<string | null>(null);
  const motion = scene.value?.motion ?? null;
  const name = scene.value?.name;
  const span = (motion?.clips.find((c) => c.name === clip.value)?.span ??
    motion?.usual ?? [0, 0]) as [number, number];
  const show = (next: number, of = clip.value): void => {
    time.value = next;
    store.send({ type: "time", clip: of, time: next });
  };
  // Another scene begins at rest.
  useEffect(() => {
    playing.value = false;
    time.value = motion?.time ?? null;
    clip.value = motion?.clip ?? null;
  }, [name, motion === null]);
  useEffect(() => {
    if (!playing.value || !motion) return;
    let [last, running] = [performance.now(), 0];
    let shown: string | undefined;
    const step = (now: number): void => {
      running = requestAnimationFrame(step);
      // The next moment is asked for when the last one has been seen.
      const { frame } = store.picture.canvas.dataset;
      if (frame === shown) return;
      shown = frame;
      show(after(time.value ?? span[0], ((now - last) / 1000) * speed.value, span));
      last = now;
    };
    running = requestAnimationFrame(step);
    return () => cancelAnimationFrame(running);
  }, [playing.value, clip.value, name]);
  if (!motion) return null;
  const shown = Math.min(Math.max(time.value ?? span[0], span[0]), span[1]);
  return (
    <div class="animation" role="toolbar" aria-label="animation">
      <button
        disabled={!steers.value}
        aria-pressed={playing.value}
        onClick={() => (playing.value = !playing.value)}
      >
        {playing.value ? "Pause" : "Play"}
      </button>
      <input
        type="range"
        min={span[0]}
        max={span[1]}
        step="any"
        value={shown}
        disabled={!steers.value}
        aria-label="time in seconds"
        onInput={(e) => {
          playing.value = false;
          show(Number(e.currentTarget.value));
        }}
      />
      <NumberInput
        label="time"
        value={Number(shown.toFixed(3))}
        fallback={span[0]}
        limits={span}
        change={(next) => {
          playing.value = false;
          if (next !== null) show(next);
        }}
      />
      <small class="wide">of {Number(span[1].toPrecision(4))} s</small>
      {motion.clips.length > 1 && (
        <select
          aria-label="animation to play"
          value={clip.value ?? ""}
          onChange={(e) => {
            const chosen = e.currentTarget.value || null;
            const found = motion.clips.find((c) => c.name === chosen);
            clip.value = chosen;
            show((found?.span ?? motion.usual)[0]!, chosen);
          }}
        >
          <option value="">as usual</option>
          {motion.clips.map((c) => (
            <option value={c.name}>{c.name}</option>
          ))}
        </select>
      )}
      <select
        aria-label="speed"
        value={String(speed.value)}
        onChange={(e) => (speed.value = Number(e.currentTarget.value))}
      >
        {SPEEDS.map((s) => (
          <option value={String(s)}>{s} ×</option>
        ))}
      </select>
    </div>
  );
}
