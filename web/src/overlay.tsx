// What is drawn over the picture: measures, outlines, axes. Each kind is a component that draws SVG
// in pixels of the picture. Tools and comparisons have palettes in the corner.

import { signal } from "@preact/signals";
import type { FunctionComponent, JSX } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Edges } from "./cad/edges";
import { AxesLines, GridLines } from "./cad/frame";
import { SectionPalette } from "./cad/section";
import { type Camera, project } from "./camera";
import { Compare, ComparePalette } from "./compare/compare";
import { HistogramPalette, Readout } from "./compare/inspect";
import { LayerColors, Legend } from "./compare/layers";
import { Gizmo } from "./gizmo";
import { LightMarks } from "./lightmarks";
import { Measures } from "./measure/marks";
import { MeasurePalette } from "./measure/palette";
import { Outline } from "./select";
import { rig, type Store, size } from "./store";
import type { Vec3 } from "./vec";

/** The camera of the picture, and where it shows points. */
export interface Sight {
  camera: Camera;
  /** Width and height of the picture in pixels. */
  size: [number, number];
  /** Pixels of the picture per pixel of the page, for lines and letters of one size. */
  unit: number;
  /** The pixel that shows a point of the world; `null` behind the eye. */
  place(point: Vec3): { x: number; y: number; depth: number } | null;
}

/** Kinds of overlay, from the lowest to the uppermost. A new kind is a new file and a line here. */
const KINDS: FunctionComponent<{ sight: Sight }>[] = [
  GridLines,
  AxesLines,
  Outline,
  Measures,
  LightMarks,
  Gizmo,
];

/** Palettes, from the top. A new one is a new file and a line here. */
const PALETTES: FunctionComponent<{ store: Store }>[] = [
  MeasurePalette,
  SectionPalette,
  ComparePalette,
  Legend,
  HistogramPalette,
];

/** Width of the picture in pixels of the page. */
const shownWidth = signal(0);

export function Overlay({ store }: { store: Store }): JSX.Element {
  const over = useRef<HTMLDivElement>(null);
  const palettes = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const resized = new ResizeObserver(([entry]) => (shownWidth.value = entry.contentRect.width));
    resized.observe(over.current!);
    // What happens on a palette is not for the picture below it.
    const keep = (event: Event): void => event.stopPropagation();
    for (const name of ["pointerdown", "pointermove", "pointerup", "dblclick", "wheel"])
      palettes.current!.addEventListener(name, keep);
    return () => resized.disconnect();
  }, []);
  const [now, [width, height]] = [rig.value, size.value];
  const sight = now && {
    camera: now.camera,
    size: [width, height] as [number, number],
    unit: shownWidth.value > 0 ? width / shownWidth.value : 1,
    place: (point: Vec3) => project(now.camera, point, [width, height]),
  };
  return (
    <div class="over" ref={over}>
      <LayerColors store={store} />
      <Edges />
      <Compare store={store} />
      {sight && (
        <svg class="overlay" viewBox={`0 0 ${width} ${height}`} aria-hidden="true">
          {KINDS.map((Kind) => (
            <Kind sight={sight} />
          ))}
        </svg>
      )}
      <div class="palettes" ref={palettes}>
        {PALETTES.map((Palette) => (
          <Palette store={store} />
        ))}
      </div>
      <Readout store={store} />
    </div>
  );
}
