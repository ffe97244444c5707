// Marks of the lights over the picture, which choose them.

import type { JSX } from "preact";
import type { Fields } from "./form";
import { chooseLight, chosenLight, placeOf, showsLights } from "./light";
import type { Sight } from "./overlay";
import { scene } from "./store";
import { tool } from "./tool";

/** More marks than this would hide the picture. */
const MOST = 200;
/** Radius of a mark, and of what a press hits, in pixels of the page. */
const [RADIUS, REACH] = [5, 14];
/** The rays around it. */
const RAYS = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => (i * Math.PI) / 4);

export function LightMarks({ sight }: { sight: Sight }): JSX.Element | null {
  if (!showsLights.value && chosenLight.value === null) return null;
  const { unit, size } = sight;
  const lights = (scene.value?.lights ?? []) as Fields[];
  return (
    <g class={tool.value ? "lamps" : "lamps live"}>
      {lights.slice(0, MOST).map((light, i) => {
        const place = placeOf(light);
        const at = place && sight.place(place);
        if (!at || at.x < 0 || at.y < 0 || at.x > size[0] || at.y > size[1]) return null;
        const r = RADIUS * unit;
        const end = (angle: number, by: number): { x: number; y: number } => ({
          x: at.x + by * r * Math.cos(angle),
          y: at.y + by * r * Math.sin(angle),
        });
        return (
          // biome-ignore lint/a11y/noStaticElementInteractions: the list in the panel does the same
          <g
            class={chosenLight.value === i ? "lamp chosen" : "lamp"}
            data-light={i}
            onPointerDown={(e) => e.stopPropagation()}
            onPointerUp={(e) => e.stopPropagation()}
            onDblClick={(e) => e.stopPropagation()}
            onClick={() => chooseLight(i)}
          >
            <title>{`light ${i}`}</title>
            <circle class="reach" cx={at.x} cy={at.y} r={REACH * unit} />
            {RAYS.map((angle) => {
              const [from, to] = [end(angle, 1.5), end(angle, 2.2)];
              return <line x1={from.x} y1={from.y} x2={to.x} y2={to.y} />;
            })}
            <circle class="bulb" cx={at.x} cy={at.y} r={r} />
          </g>
        );
      })}
    </g>
  );
}
