// The numbers below the picture.

import type { JSX } from "preact";
import type { SceneInfo } from "./protocol.gen";
import { connected, numbers, scene } from "./store";

/** How much there is in a scene. */
export function contents({ triangles, shapes }: Pick<SceneInfo, "triangles" | "shapes">): string {
  const counted = (count: number, name: string): string =>
    `${count.toLocaleString("en")} ${name}${count === 1 ? "" : "s"}`;
  const all = [
    ...(triangles > 0 || shapes === 0 ? [counted(triangles, "triangle")] : []),
    ...(shapes > 0 ? [counted(shapes, "shape")] : []),
  ];
  return all.join(", ");
}

export function Status(): JSX.Element {
  const n = numbers.value;
  const moving = n.wanted === 0;
  const isDone = !moving && n.samples >= n.wanted;
  const state = !connected.value ? "lost" : moving ? "moving" : isDone ? "done" : "";
  const percent = (x: number): string => `${Number((x * 100).toPrecision(2))} %`;
  return (
    <div class="status" role="status" aria-live="off">
      <span class={`dot ${state}`} />
      {moving ? (
        <>
          <span>{n.framesPerSecond} frames/s</span>
          <span>{n.latency.toFixed(0)} ms</span>
          <span>scale {percent(n.scale)}</span>
        </>
      ) : (
        <>
          <span data-testid="samples">
            {n.samples} of {n.wanted} samples
          </span>
          {n.denoised > 0 && (
            <span title="What is saved are the true samples">denoised {percent(n.denoised)}</span>
          )}
          {Number.isFinite(n.noise) && <span>noise {percent(n.noise)}</span>}
          <span>{n.seconds.toFixed(1)} s</span>
        </>
      )}
      <span class="space" />
      <span>
        {n.size[0]} × {n.size[1]}
      </span>
      {scene.value && <span class="wide">{contents(scene.value)}</span>}
      {!moving && n.wanted > 0 && (
        <progress max={n.wanted} value={n.samples} aria-label="samples" />
      )}
    </div>
  );
}
