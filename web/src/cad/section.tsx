// The section: a plane cuts the scene open.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { useDismiss } from "../dismiss";
import { NumberInput } from "../number";
import { rig, type Store, scene, view } from "../store";
import { tool, use } from "../tool";
import { Press } from "../touch";
import { dot, mul, type Vec3 } from "../vec";
import {
  AXES,
  axisOf,
  facing,
  flipped,
  planeOf,
  type Section,
  sectionOf,
  sign,
  span,
  through,
} from "./plane";

export const showsSection = signal(false);
const NAME = "Section at a face";

function set(store: Store, section: Section | null): void {
  if (store.rig) store.setCamera({ ...store.rig.camera, clip: section && planeOf(section) });
}

/** The integrator that shows colours without light. */
const UNLIT = "flat";
/** The integrator before. */
let lit = "path";

/** Shows colours without light, or with it again: no light gets into a closed body. */
function toggleLight(store: Store): void {
  const now = view.value?.integrator ?? lit;
  if (now !== UNLIT) lit = now;
  store.send({ type: "render", integrator: now === UNLIT ? lit : UNLIT });
}

/**
 * Opens the panel with a section through the middle of the subject, or closes it; with the panel
 * the section ends too.
 */
export function toggleSection(store: Store): void {
  const camera = store.rig?.camera;
  const isOpen = showsSection.value || Boolean(camera?.clip);
  showsSection.value = !isOpen;
  if (isOpen) {
    set(store, null);
    if (tool.value?.name === NAME) use(null);
  } else if (camera && scene.value) {
    const subject = scene.value.subject as [Vec3, Vec3];
    set(store, through(facing(camera), subject, camera));
  }
}

/**
 * The next click sets the plane: onto the face that is hit, to be moved inwards. Until then nothing
 * is cut, so that all faces can be hit.
 */
function pickFace(store: Store): void {
  set(store, null);
  use({
    name: NAME,
    hint: `${Press()} on the face to cut along`,
    click(at) {
      use(null);
      void store.pick(...at).then((hit) => {
        if (!hit) return;
        const normal = hit.facing as Vec3;
        set(store, { normal, offset: dot(hit.position as Vec3, normal) });
      });
    },
  });
}

export function SectionPalette({ store }: { store: Store }): JSX.Element | null {
  const info = scene.value;
  const camera = rig.value?.camera;
  const now = camera?.clip ? sectionOf(camera.clip) : null;
  const isOpen = showsSection.value || now !== null;
  // A tool ends first.
  useDismiss(isOpen && tool.value === null, () => toggleSection(store));
  if (!camera || !info || !isOpen) return null;
  const bounds = info.bounds as [Vec3, Vec3];
  const side = now ? sign(now) : 1;
  const [low, high] = now ? span(bounds, mul(now.normal, side)) : [0, 1];
  const move = (place: number): void => set(store, { ...now!, offset: place * side });
  return (
    <section class="palette" aria-label="section">
      <fieldset class="row" aria-label="what the section is perpendicular to">
        {AXES.map(({ name, axis }) => (
          <button
            aria-pressed={now !== null && axisOf(now) === name}
            aria-label={`section across ${name}`}
            onClick={() => set(store, through(axis, bounds, camera))}
          >
            {name}
          </button>
        ))}
        <button aria-pressed={tool.value?.name === NAME} onClick={() => pickFace(store)}>
          Face
        </button>
        <button disabled={!now} onClick={() => now && set(store, flipped(now))}>
          Flip
        </button>
        <button
          aria-pressed={view.value?.integrator === UNLIT}
          title="Colours without light: closed bodies are dark inside"
          onClick={() => toggleLight(store)}
        >
          Unlit
        </button>
        <button disabled={!now} onClick={() => set(store, null)}>
          Off
        </button>
        <button aria-label="end the section" onClick={() => toggleSection(store)}>
          ×
        </button>
      </fieldset>
      {now && (
        <div class="row">
          <input
            type="range"
            min={low}
            max={high}
            step={(high - low) / 1000 || 1}
            value={now.offset * side}
            aria-label="place of the section"
            onInput={(e) => move(Number(e.currentTarget.value))}
          />
          <NumberInput
            label="place of the section, in units of the scene"
            value={now.offset * side}
            digits={5}
            change={(place) => place !== null && move(place)}
          />
        </div>
      )}
    </section>
  );
}
