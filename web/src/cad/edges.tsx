// Edges over the picture: outlines, creases and borders of what is seen.

import { signal, useSignalEffect } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import { edges as ask } from "../compare/server";
import { latest } from "../latest";
import { numbers, rig, scene, size } from "../store";

export const showsEdges = signal(false);

/** Points of a map per pixel along each side at rest. */
const FINE = 2;
/** The least and the most of them while something moves. */
const COARSE = [0.15, 0.6] as const;
/** Lines that follow a motion should not take longer than this, milliseconds. */
const QUICK = 40;
/** Maximum number of points of a map. */
const MOST = 8e6;

export function Edges(): JSX.Element {
  const canvas = useRef<HTMLCanvasElement>(null);
  const known = useRef("");
  const coarse = useRef<number>(COARSE[1]);

  const draw = async (): Promise<void> => {
    const camera = rig.peek()?.camera;
    if (!camera || !canvas.current || !showsEdges.peek()) return;
    const isAtRest = numbers.peek().wanted > 0;
    const [w, h] = size.peek();
    const scale = Math.min(isAtRest ? FINE : coarse.current, Math.sqrt(MOST / (w * h)));
    const wanted: [number, number] = [Math.round(w * scale) || 1, Math.round(h * scale) || 1];
    const what = JSON.stringify([camera, wanted, scene.peek()?.generation]);
    if (what === known.current) return;
    const start = performance.now();
    // The server may be busy with another scene; the next picture asks again.
    const mask = await ask(camera, wanted).catch(() => null);
    if (!mask) return;
    if (!isAtRest) {
      const ratio = Math.sqrt(QUICK / Math.max(1, performance.now() - start));
      const next = coarse.current * Math.max(0.5, Math.min(1.25, ratio));
      coarse.current = Math.max(COARSE[0], Math.min(COARSE[1], next));
    }
    known.current = what;
    const image = new ImageData(...wanted);
    mask.forEach((on, i) => {
      image.data[4 * i + 3] = on;
    });
    [canvas.current.width, canvas.current.height] = wanted;
    canvas.current.getContext("2d")!.putImageData(image, 0, 0);
    canvas.current.dataset.lines = String(mask.reduce((sum, on) => sum + (on > 0 ? 1 : 0), 0));
  };

  const redraw = useRef(latest(draw)).current;
  useSignalEffect(() => {
    // Lines follow every picture.
    void [numbers.value, rig.value, scene.value];
    if (showsEdges.value) redraw();
  });
  return <canvas ref={canvas} class="picture reference edges" hidden={!showsEdges.value} />;
}
